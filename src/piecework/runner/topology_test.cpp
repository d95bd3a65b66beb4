#include <piecework/runner/topology.hpp>

#include <sched.h>

#include <algorithm>

#include <gtest/gtest.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

#include "small_scene.hpp"

namespace piecework::runner {
namespace {

TEST(Topology, ASimulatedMachineIsReadFastestFirst) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "hybrid.json";
  write_file_atomically(file, R"({"kinds": [
      {"name": "efficient", "cores": 8, "speed": 0.55},
      {"name": "performance", "cores": 6, "threads": 12, "speed": 1.0}]})");
  const Topology topology = load_topology(file);
  ASSERT_EQ(topology.kinds.size(), 2U);
  EXPECT_EQ(topology.kinds[0].name, "performance");
  EXPECT_EQ(topology.kinds[0].threads, 12);
  EXPECT_EQ(topology.kinds[1].speed, 0.55);
  EXPECT_EQ(topology.kinds[1].threads, 8);
  EXPECT_EQ(topology.cores(), 14);
  EXPECT_FALSE(topology.uniform());
  EXPECT_EQ(topology.source, file.string());
}

TEST(Topology, FaultsNameFileItemAndValue) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "bad.json";
  struct Fault {
    const char* text;
    const char* pointer;
    const char* says;
  };
  const Fault faults[] = {
      {"{", "/", "no JSON"},
      {"[3]", "/", "[3] is no object"},
      {"{}", "/", "\"kinds\" is missing"},
      {R"({"kinds": [], "x": 1})", "/", "unknown key \"x\""},
      {R"({"kinds": []})", "/kinds", "[] is no list"},
      {R"({"kinds": [7]})", "/kinds/0", "7 is no object"},
      {R"({"kinds": [{"name": "a", "cores": 1}]})", "/kinds/0", "\"speed\" is missing"},
      {R"({"kinds": [{"name": "a", "cores": 1, "speed": 1, "ghz": 3}]})", "/kinds/0", "\"ghz\""},
      {R"({"kinds": [{"name": "", "cores": 1, "speed": 1}]})", "/kinds/0/name", "is no name"},
      {R"({"kinds": [{"name": "a", "cores": 0, "speed": 1}]})", "/kinds/0/cores", "0 is no count"},
      {R"({"kinds": [{"name": "a", "cores": 1.5, "speed": 1}]})", "/kinds/0/cores", "1.5"},
      {R"({"kinds": [{"name": "a", "cores": 99999999999, "speed": 1}]})", "/kinds/0/cores", "9999"},
      {R"({"kinds": [{"name": "a", "cores": 1, "speed": 0}]})", "/kinds/0/speed", "0 is no speed"},
      {R"({"kinds": [{"name": "a", "cores": 1, "speed": "x"}]})", "/kinds/0/speed", "\"x\""},
      {R"({"kinds": [{"name": "a", "cores": 1, "speed": 1}, {"name": "a", "cores": 1, "speed": 1}]})",
       "/kinds/1", "a second kind named \"a\""},
  };
  for (const Fault& fault : faults) {
    SCOPED_TRACE(fault.text);
    write_file_atomically(file, fault.text);
    try {
      (void)load_topology(file);
      ADD_FAILURE() << "accepted";
    } catch (const InputError& error) {
      const std::string text = error.what();
      EXPECT_EQ(text.rfind(file.string() + ": " + fault.pointer + ": ", 0), 0U) << text;
      EXPECT_NE(text.find(fault.says), std::string::npos) << text;
      EXPECT_NE(text.find("; "), std::string::npos) << text;
    }
  }
  EXPECT_THROW((void)load_topology(folder.path() / "missing.json"), InputError);
}

TEST(Topology, ThisMachineHasUsableCores) {
  const Topology topology = machine_topology();
  EXPECT_GE(topology.cores(), 1);
  EXPECT_TRUE(topology.uniform()) << "before anything is measured";
  for (const CoreKind& kind : topology.kinds) EXPECT_GE(kind.threads, kind.cores);
}

std::vector<int> affinity() {
  cpu_set_t set;
  CPU_ZERO(&set);
  EXPECT_EQ(sched_getaffinity(0, sizeof(set), &set), 0);
  std::vector<int> processors;
  for (int p = 0; p < CPU_SETSIZE; ++p)
    if (CPU_ISSET(p, &set)) processors.push_back(p);
  return processors;
}

/// Two names for the same processor: what is measured differs by noise only, but is measured.
TEST(Topology, MeasuringLeavesTheAffinityAsItWas) {
  const std::vector<int> before = affinity();
  const CoreKind kind{.name = "a", .processors = {before.front()}};
  Topology topology{.kinds = {kind, kind}, .source = "test"};
  topology.kinds[0].speed = 7;
  ASSERT_TRUE(measure_speeds(topology));
  EXPECT_EQ(affinity(), before);
  EXPECT_EQ(topology.kinds[0].speed, 1) << "the fastest";
  EXPECT_GE(topology.kinds[1].speed, 0.05);
  EXPECT_LE(topology.kinds[1].speed, 1);
}

TEST(Topology, OneKindIsNotMeasuredAndAForbiddenCoreIsNoError) {
  Topology one{.kinds = {{.name = "a", .speed = 7, .processors = {0}}}, .source = "test"};
  EXPECT_FALSE(measure_speeds(one));
  EXPECT_EQ(one.kinds[0].speed, 1);
  const std::vector<int> before = affinity();
  const CoreKind mine{.name = "a", .processors = {before.front()}};
  const CoreKind nowhere{.name = "b", .processors = {1 << 20}};
  Topology two{.kinds = {mine, nowhere}, .source = "test"};
  EXPECT_FALSE(measure_speeds(two));
  EXPECT_TRUE(two.uniform());
  EXPECT_EQ(affinity(), before);
}

}  // namespace
}  // namespace piecework::runner
