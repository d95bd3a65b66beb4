// Which solvers know of contact.

#include <gtest/gtest.h>

#include <piecework/core/error.hpp>
#include <piecework/runner/methods.hpp>

#include "small_scene.hpp"

namespace piecework::runner {
namespace {

/// What make_integrator() says against a scene; empty if nothing.
std::string refused(std::vector<scene::Override> overrides, bool self_collision = true) {
  overrides.push_back({"self_collision", self_collision ? "true" : "false"});
  const auto world = build_world(small_scene(overrides));
  try {
    (void)make_integrator(*world);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(ContactMethods, OthersAreRefusedWithTheRemedy) {
  for (const char* method : {"vanilla_pd", "newton", "pd_jacobi", "xpbd"}) {
    EXPECT_EQ(refused({{"solver.method", method}}),
              std::string("small.json: /solver/method: \"") + method +
                  "\" knows nothing of contact; choose \"dd_pd\", or leave out "
                  "\"self_collision\" and \"colliders\"");
    EXPECT_EQ(refused({{"solver.method", method}}, false), "");
  }
}

TEST(ContactMethods, SweepsAreRefused) {
  EXPECT_EQ(refused({{"solver.local", "gauss_seidel"}}),
            "small.json: /solver/local: \"gauss_seidel\" moves vertices without asking contact; "
            "write \"jacobi\", or leave out \"self_collision\" and \"colliders\"");
  EXPECT_NE(refused({{"solver.local", "literal_eq12"}, {"quality.accelerate", "none"}}), "");
  EXPECT_EQ(refused({}), "");
}

}  // namespace
}  // namespace piecework::runner
