#pragma once

// Private to the module: numbers and names as cells of Markdown tables.

#include <string>

#include <piecework/core/statistics.hpp>

namespace piecework::runner {

inline constexpr const char* kOff = "-";  ///< off, not run, or not known

/// Three significant digits, without exponent where a person would not write one.
std::string three_digits(double value);

/// A name that cannot break a table.
std::string plain_cell(const std::string& name);

/// "12.3 [11.9-12.8]": median and its 95 % interval, from 6 samples on.
std::string median_cell(const MedianInterval& median);

}  // namespace piecework::runner
