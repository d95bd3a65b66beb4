#pragma once

// Private to the module: nlohmann's parser, with the positions it does not keep.

#include <string>
#include <string_view>

#include <piecework/scene/document.hpp>

namespace piecework::scene {

/// Parses `text` as the last of document.sources. Errors are reported below `base_pointer`.
/// \throws InputError as parse_document().
Node parse_json(const Document& document, std::string_view text, const std::string& base_pointer);

/// The value of an override, whose source is the last of document.sources: JSON, or a plain string
/// if it does not look like JSON. All its places have line 0.
/// \throws InputError if it opens like JSON ({, [ or ") and is not, overflows, or is not UTF-8.
Node parse_override(const Document& document, std::string_view text, const std::string& pointer);

}  // namespace piecework::scene
