#pragma once

// Private to the module: what tables are made of.

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

/// "- key: value" lines of a flat JSON object.
std::string list_of(const std::string& json);

/// A number in CSV, nine digits; empty if there is no such number.
std::string csv_number(double value);

}  // namespace piecework::runner
