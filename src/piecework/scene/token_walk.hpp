#pragma once

// Private to the module: walks over the tokens of JSON text, counting lines and columns. It does
// not judge the text (nlohmann's parser does); it only says where each token begins, so it must
// find the same tokens in valid text, and must not run past the end of any text.

#include <cstdint>
#include <string_view>

namespace piecework::scene {

struct Token {
  std::size_t begin = 0,
              end = 0;  ///< byte offsets; equal at the end of the text
  std::uint32_t line = 1, column = 1;

  [[nodiscard]] std::string_view in(std::string_view text) const {
    return text.substr(begin, end - begin);
  }
};

class TokenWalk {
 public:
  explicit TokenWalk(std::string_view text) : text_(text) {
    if (text_.starts_with("\xEF\xBB\xBF")) at_ = 3;  // the byte order mark has no column
  }

  /// The next token: a string with its quotes, one of []{},: or a run of other characters.
  Token next() {
    skip_blanks();
    Token token{at_, at_, line_, column_};
    if (at_ < text_.size()) {
      if (text_[at_] == '"')
        pass_string();
      else if (is_punctuation(text_[at_]))
        advance();
      else
        pass_run();
    }
    token.end = at_;
    return token;
  }

 private:
  static bool is_punctuation(char c) {
    return std::string_view("[]{},:").find(c) != std::string_view::npos;
  }
  static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }
  [[nodiscard]] bool starts(std::string_view what) const {
    return text_.substr(at_).starts_with(what);
  }

  void advance() {
    const auto byte = static_cast<unsigned char>(text_[at_++]);
    if (byte == '\n')
      ++line_, column_ = 1;
    else if ((byte & 0xC0U) != 0x80U)  // UTF-8 continuation bytes are no characters of their own
      ++column_;
  }

  void skip_blanks() {
    while (at_ < text_.size()) {
      if (is_blank(text_[at_]))
        advance();
      else if (starts("//"))
        while (at_ < text_.size() && text_[at_] != '\n' && text_[at_] != '\r') advance();
      else if (starts("/*") && text_.find("*/", at_ + 2) != std::string_view::npos)
        pass_comment();
      else
        return;
    }
  }

  void pass_comment() {
    const std::size_t end = text_.find("*/", at_ + 2) + 2;
    while (at_ < end) advance();
  }

  void pass_string() {
    advance();
    while (at_ < text_.size()) {
      const char c = text_[at_];
      advance();
      if (c == '"' || c == '\n') return;
      if (c == '\\' && at_ < text_.size()) advance();
    }
  }

  void pass_run() {
    const bool open_comment = starts("/*");
    while (at_ < text_.size() &&
           (open_comment || !(is_blank(text_[at_]) || is_punctuation(text_[at_]) ||
                              text_[at_] == '"' || starts("//") || starts("/*"))))
      advance();
  }

  std::string_view text_;
  std::size_t at_ = 0;
  std::uint32_t line_ = 1, column_ = 1;
};

}  // namespace piecework::scene
