#include <piecework/collision/ccd_query_file.hpp>

#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <piecework/core/error.hpp>
#include <piecework/core/random.hpp>

namespace piecework::collision {
namespace {

namespace fs = std::filesystem;

class CcdQueryFiles : public ::testing::Test {
 protected:
  void TearDown() override { fs::remove(path_); }

  CcdQueryFile read(const std::string& text, PairKind kind = PairKind::EdgeEdge) const {
    std::ofstream(path_, std::ios::binary) << text;
    return read_ccd_queries(path_, kind);
  }

  /// The one coordinate that is not zero in a file of one query.
  double coordinate(const std::string& numerator, const std::string& denominator) const {
    return read(fmt::format("{},{},0,1,0,1,1\n", numerator, denominator) + lines(7))
        .queries.at(0)
        .start[0][0];
  }

  void expect_refused(const std::string& text, const std::string& part) const {
    try {
      read(text);
      ADD_FAILURE() << "accepted: " << text;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
      EXPECT_EQ(std::string(error.what()).find(path_.string()), 0U) << error.what();
    }
  }

  static std::string lines(int count, const std::string& end = "\n") {
    std::string text;
    for (int i = 0; i < count; ++i) text += "0,1,0,1,0,1,1" + end;
    return text;
  }

  fs::path path_ = fs::temp_directory_path() / fmt::format("ccd_queries_{}.csv", ::getpid());
};

TEST_F(CcdQueryFiles, PointsComeInOrder) {
  std::string text;
  for (int query = 0; query < 2; ++query)
    for (int i = 0; i < 8; ++i)
      text += fmt::format("{},1,{},2,{},4,{}\n", i, -i, 100 * query + i, query);
  const CcdQueryFile file = read(text, PairKind::VertexTriangle);
  ASSERT_EQ(file.queries.size(), 2U);
  EXPECT_EQ(file.truth, (std::vector<char>{0, 1}));
  EXPECT_EQ(file.rounded_coordinates, 0U);
  for (std::size_t query = 0; query < 2; ++query) {
    const CcdQuery& q = file.queries[query];
    EXPECT_EQ(q.kind, PairKind::VertexTriangle);
    for (std::size_t i = 0; i < 8; ++i) {
      const auto x = static_cast<double>(i);
      EXPECT_EQ(i < 4 ? q.start[i] : q.end[i - 4],
                Vec3(x, -x / 2, (100 * static_cast<double>(query) + x) / 4));
    }
  }
}

TEST_F(CcdQueryFiles, LineEndsOfAnyKind) {
  const std::string last = "0,1,0,1,0,1,1";
  EXPECT_EQ(read(lines(8)).queries.size(), 1U);
  EXPECT_EQ(read(lines(7) + last).queries.size(), 1U);
  EXPECT_EQ(read(lines(8, "\r\n")).queries.size(), 1U);
  EXPECT_EQ(read(lines(7, "\r\n") + last).queries.size(), 1U);
  EXPECT_EQ(read(lines(8) + "\n").queries.size(), 1U);
  EXPECT_EQ(read(lines(7) + " 0 , 1,0,1,0,1,\t1 \n").queries.size(), 1U);
}

TEST_F(CcdQueryFiles, CoordinatesAreTheNearestDoubles) {
  EXPECT_EQ(coordinate("1", "3"), 1.0 / 3);
  EXPECT_EQ(coordinate("-2", "3"), -2.0 / 3);
  EXPECT_EQ(coordinate("2", "-3"), -2.0 / 3);
  EXPECT_EQ(coordinate("-0", "7"), 0);
  // Ties go to the even neighbour: 2^53 + 1 and 2^53 + 3.
  EXPECT_EQ(coordinate("9007199254740993", "1"), 9007199254740992.0);
  EXPECT_EQ(coordinate("9007199254740995", "1"), 9007199254740996.0);
  EXPECT_EQ(coordinate("-9007199254740995", "1"), -9007199254740996.0);
  // A tie that the 40th digit breaks.
  EXPECT_EQ(coordinate("90071992547409930000000000000000000000001", "10000000000000000000000000"),
            9007199254740994.0);
  const std::string zeros(308, '0');
  EXPECT_EQ(coordinate("1" + zeros, "1"), 1e308);
  EXPECT_EQ(coordinate("1", "1" + zeros), 1e-308);
  EXPECT_EQ(coordinate("15", "1" + zeros + "0000000000"), 1.5e-317);  // subnormal
  EXPECT_EQ(coordinate("1", "1" + zeros + zeros), 0);
  EXPECT_EQ(coordinate("7" + zeros + zeros, "2" + zeros + zeros), 3.5);
}

TEST_F(CcdQueryFiles, AgreesWithStrtodOnRandomDecimals) {
  Random random(3);
  std::size_t rounded = 0;
  for (int i = 0; i < 500; ++i) {
    std::string digits = "1";
    const int length = 1 + static_cast<int>(random.uniform() * 40);
    for (int k = 0; k < length; ++k)
      digits += static_cast<char>('0' + static_cast<int>(random.uniform() * 10));
    const int exponent = static_cast<int>(random.uniform() * 330);
    EXPECT_EQ(coordinate(digits, "1" + std::string(static_cast<std::size_t>(exponent), '0')),
              std::strtod(fmt::format("{}e-{}", digits, exponent).c_str(), nullptr));
    rounded += read_ccd_queries(path_, PairKind::EdgeEdge).rounded_coordinates;
  }
  EXPECT_GT(rounded, 400U);
}

TEST_F(CcdQueryFiles, WhatIsWrongIsNamedWithItsLine) {
  expect_refused("", "no queries");
  expect_refused(lines(3) + "0,1,0,1,0,1\n", ":4: 6 fields");
  expect_refused(lines(3) + "0,1,0,1,0,1,1,1\n", ":4: 8 fields");
  expect_refused(lines(3) + "\n" + lines(5), ":4: 1 fields");
  expect_refused(lines(2) + "0,1,0,0,0,1,1\n", ":3: a denominator is zero");
  for (const char* bad : {"", "x", "1.5", "1e3", "+1", "--1", "-", "1 2", "0x10", "nan"})
    expect_refused(lines(1) + fmt::format("{},1,0,1,0,1,1\n", bad), ":2: \"");
  expect_refused("0,1,0,1,0,1,2\n", ":1: truth \"2\"");
  expect_refused("0,1,0,1,0,1,\n", ":1: truth \"\"");
  expect_refused(lines(5) + "0,1,0,1,0,1,0\n", ":6: truth differs");
  expect_refused("1" + std::string(309, '0') + ",1,0,1,0,1,0\n", ":1: a coordinate is beyond");
  expect_refused(lines(8) + lines(5), ":13: the last query has 5 of 8 points");
  fs::remove(path_);
  EXPECT_THROW(read_ccd_queries(path_, PairKind::EdgeEdge), InputError);
  EXPECT_THROW(read_ccd_queries(fs::temp_directory_path(), PairKind::EdgeEdge), InputError);
}

}  // namespace
}  // namespace piecework::collision
