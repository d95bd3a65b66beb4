#include <piecework/runner/start.hpp>

#include <gtest/gtest.h>
TEST(Start, Later) {}
