#pragma once

// Messages to the user, on stderr. A log that cannot be written must not end a simulation, so
// failures to print are ignored.

#include <cstdio>
#include <string>
#include <utility>

#include <fmt/format.h>

namespace piecework::cli {

template <class... Args>
void say(fmt::format_string<Args...> format, Args&&... args) {
  const std::string text = fmt::format(format, std::forward<Args>(args)...);
  std::fputs(text.c_str(), stderr);
  std::fflush(stderr);
}

}  // namespace piecework::cli
