#include <piecework/scene/json_parser.hpp>

#include <charconv>
#include <unordered_set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <piecework/scene/token_walk.hpp>

namespace piecework::scene {
namespace {

using Json = nlohmann::json;

struct SyntaxError {
  std::string problem, remedy;
};

/// "unexpected '}', expected string literal" out of nlohmann's message.
std::string reason(const std::string& message) {
  const std::size_t dash = message.find(" - ");
  std::string text = dash == std::string::npos ? message : message.substr(dash + 3);
  if (const std::size_t read = text.find("; last read: '"); read != std::string::npos)
    text.erase(read);
  for (std::size_t at = 0; (at = text.find(';', at)) != std::string::npos;) text[at] = ',';
  return text;
}

/// Receives the parser's events and builds the tree. Each event belongs to the next token that is
/// neither ',' nor ':', so a walk over the tokens in step with the events gives the positions.
class Builder : public nlohmann::json_sax<Json> {
 public:
  Builder(const Document& document, std::string_view text, std::string base_pointer, bool places)
      : document_(document),
        source_(static_cast<std::uint32_t>(document.sources.size() - 1)),
        text_(text),
        walk_(text),
        base_pointer_(std::move(base_pointer)),
        places_(places) {}

  Node take() { return std::move(root_); }

  bool null() override { return leaf(nullptr); }
  bool boolean(bool value) override { return leaf(value); }
  bool number_integer(number_integer_t value) override { return leaf(static_cast<double>(value)); }
  bool number_unsigned(number_unsigned_t value) override {
    return leaf(static_cast<double>(value));
  }
  bool number_float(number_float_t value, const string_t&) override { return leaf(value); }
  bool string(string_t& value) override { return leaf(std::move(value)); }
  bool binary(binary_t&) override { return false; }  // JSON text has none
  bool start_object(std::size_t) override { return open(Object{}); }
  bool start_array(std::size_t) override { return open(List{}); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }

  bool key(string_t& name) override {
    Open& top = open_.back();
    top.key_place = step();
    top.key = std::move(name);
    if (!top.seen.insert(top.key).second)
      fail(document_, top.key_place, pointer(),
           fmt::format("duplicate key \"{}\"", printable(top.key)), "keep one of the two");
    return true;
  }

  bool parse_error(std::size_t position, const std::string&,
                   const nlohmann::detail::exception& error) override {
    Token before = token_;
    const Token offending = find_offending(position, error.what(), before);
    const Place place = place_of(offending);
    constexpr int kOverflow = 406;
    if (error.id == kOverflow)
      fail(document_, place, pointer(),
           fmt::format("the number {} is too large", printable(offending.in(text_))),
           "write a finite number below 1.8e308");
    const SyntaxError syntax = explain(before, offending, reason(error.what()));
    fail(document_, place, pointer(), "syntax error: " + syntax.problem, syntax.remedy);
  }

 private:
  struct Open {
    Node* node;
    std::string key;
    Place key_place;
    std::unordered_set<std::string> seen;
  };

  Place place_of(const Token& token) const {
    return {source_, places_ ? token.line : 0, places_ ? token.column : 0};
  }

  /// Takes the token of the event that is being handled.
  Place step() {
    do token_ = walk_.next();
    while (token_.in(text_) == "," || token_.in(text_) == ":");
    return place_of(token_);
  }

  template <class T>
  bool leaf(T value) {
    add(std::move(value));
    return true;
  }

  template <class T>
  Node& add(T value) {
    const Place place = step();
    if (++count_ > kMaxValues)
      fail(document_, place, pointer(), fmt::format("more than {} values", kMaxValues),
           "name vertices by sets or boxes instead of listing them");
    List* siblings = nullptr;
    Node node;
    node.data.emplace<T>(std::move(value));
    node.place = place;
    if (open_.empty()) return root_ = std::move(node);
    // Only the innermost open container grows, so pointers to the outer ones stay valid.
    Open& top = open_.back();
    if (auto* object = std::get_if<Object>(&top.node->data)) {
      siblings = &object->members;
      node.key = std::move(top.key);
      node.key_place = top.key_place;
      top.key.clear();
    } else {
      siblings = &std::get<List>(top.node->data);
    }
    siblings->push_back(std::move(node));
    return siblings->back();
  }

  template <class T>
  bool open(T container) {
    const std::string here = open_.size() >= kMaxDepth ? pointer() : "";
    Node& node = add(std::move(container));
    if (open_.size() >= kMaxDepth)
      fail(document_, node.place, here, fmt::format("nested deeper than {} levels", kMaxDepth),
           "a scene needs fewer than 10; check the brackets");
    open_.push_back({&node, {}, {}, {}});
    return true;
  }

  bool close() {
    step();
    open_.pop_back();
    return true;
  }

  /// Pointer of the value that is being read.
  [[nodiscard]] std::string pointer() const {
    std::string text = base_pointer_;
    for (const Open& level : open_) {
      if (const List* list = level.node->list())
        text += fmt::format("/{}", list->size() - (&level != &open_.back() ? 1 : 0));
      else if (&level != &open_.back())
        text += pointer_step(level.node->object()->back().key);
      else if (!level.key.empty())
        text += pointer_step(level.key);
    }
    return text;
  }

  /// The token at which the parser gave up after consuming `position` bytes; `previous` becomes the
  /// one before it.
  Token find_offending(std::size_t position, std::string_view message, Token& previous) const {
    // The lexer stops one byte after the end of a bad word, number, comment or open string.
    bool one_after = false;
    for (const char* fault :
         {"invalid literal", "invalid number", "invalid comment", "closing quote"})
      one_after = one_after || message.find(fault) != std::string_view::npos;
    const auto reaches = [&](const Token& token) {
      const bool mark =
          std::string_view("[]{},:").find(text_[token.begin]) != std::string_view::npos;
      return token.end + (one_after && !mark ? 1 : 0) >= position;
    };
    TokenWalk walk = walk_;
    Token token = token_;
    if (token.end > token.begin && token.end >= position) return token;
    do {
      previous = token;
      token = walk.next();
    } while (token.end > token.begin && !reaches(token));
    return token;
  }

  /// What to tell about the token `offending`, which follows `before`; `detail` is nlohmann's view.
  SyntaxError explain(const Token& before, const Token& offending, std::string detail) const {
    const std::string_view text = offending.in(text_), previous = before.in(text_);
    const std::string word = printable(text);
    if (text.empty()) return explain_end();
    if (detail.starts_with("invalid string")) return {detail, "correct the string"};
    if (detail.starts_with("invalid comment"))
      return {detail, "comments are // to the end of the line or /* ... */"};
    if (text.front() == '\'') return {"unexpected '", "write text in double quotes"};
    if (detail.starts_with("invalid literal") &&
        std::string_view("+.").find(word[0]) != std::string_view::npos)
      return {fmt::format("{} is not a number", word), "write it like 0.5, -3 or 1e-3"};
    if (detail.starts_with("invalid literal"))
      return {fmt::format("unexpected {}", word),
              "text needs double quotes; other words are true, false and null; "
              "numbers are finite"};
    // What follows a leading zero is a second number to the lexer.
    if (detail.starts_with("invalid number") || offending.begin == before.begin)
      return {fmt::format("{} is not a number", word), "write it like 0.5, -3 or 1e-3"};
    const bool closing = text == "}" || text == "]";
    if (open_.empty() && !previous.empty())
      return {fmt::format("unexpected {} after the end of the scene", word), "remove what follows"};
    if (previous == "," && closing)
      return {fmt::format("a comma before {}", text), "remove that comma"};
    if (starts_value(text) && ends_value(previous))
      return {fmt::format("unexpected {} after {}", word, printable(previous)),
              "put a comma or a colon between them"};
    return {detail, "correct the punctuation here or just before"};
  }

  SyntaxError explain_end() const {
    if (open_.empty()) return {"there is no value", "write { \"cloths\": [ ... ] }"};
    const Node& node = *open_.back().node;
    return {places_ ? fmt::format("the text ends inside what line {}, column {} began",
                                  node.place.line, node.place.column)
                    : "the text ends too early",
            node.list() ? "close it with ]" : "close it with }"};
  }

  static bool starts_value(std::string_view token) {
    return std::string_view("]},:").find(token.front()) == std::string_view::npos;
  }
  static bool ends_value(std::string_view token) {
    return !token.empty() && std::string_view("[{,:").find(token.front()) == std::string_view::npos;
  }

  const Document& document_;
  std::uint32_t source_;
  std::string_view text_;
  TokenWalk walk_;
  std::string base_pointer_;
  bool places_;
  Token token_;  ///< of the latest event
  Node root_;
  std::vector<Open> open_;
  std::size_t count_ = 0;
};

Node parse(const Document& document, std::string_view text, const std::string& base_pointer,
           bool places) {
  Builder builder(document, text, base_pointer, places);
  // Every failure leaves the builder as an exception; nlohmann's result has nothing to add.
  (void)Json::sax_parse(text.begin(), text.end(), &builder, nlohmann::detail::input_format_t::json,
                        /*strict=*/true, /*ignore_comments=*/true);
  return builder.take();
}

bool is_json(std::string_view text) {
  return Json::accept(text.begin(), text.end(), /*ignore_comments=*/true);
}

/// A number, though perhaps not one to JSON (+5) or to a double (1e999): worth an error if so.
bool is_number(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double ignored = 0;
  const auto result = std::from_chars(text.data(), text.data() + text.size(), ignored);
  return result.ec != std::errc::invalid_argument && result.ptr == text.data() + text.size() &&
         text.find_first_of("0123456789") != std::string_view::npos;
}

}  // namespace

Node parse_json(const Document& document, std::string_view text, const std::string& base_pointer) {
  const auto source = static_cast<std::uint32_t>(document.sources.size() - 1);
  if (text.size() > kMaxTextBytes)
    fail(document, {source, 0, 0}, base_pointer,
         fmt::format("{} bytes, the limit is {}", text.size(), kMaxTextBytes),
         "put meshes into mesh files and name vertices by sets");
  // The lexer would take a zero byte for the end and ignore what follows.
  if (const std::size_t zero = text.find('\0'); zero != std::string_view::npos)
    fail(document, {source, 0, 0}, base_pointer, fmt::format("byte {} is zero", zero),
         "this is not a text file; name a scene");
  return parse(document, text, base_pointer, /*places=*/true);
}

Node parse_override(const Document& document, std::string_view text, const std::string& pointer) {
  const Place place{static_cast<std::uint32_t>(document.sources.size() - 1), 0, 0};
  const bool opens_like_json =
      text.starts_with('{') || text.starts_with('[') || text.starts_with('"');
  const bool readable = text.find('\0') == std::string_view::npos && text.size() <= kMaxTextBytes;
  if (readable && (opens_like_json || is_number(text) || is_json(text)))
    return parse(document, text, pointer, /*places=*/false);
  Node node{std::string(text), place, {}, {}};
  // Text goes into files and messages, which are UTF-8: nlohmann's lexer is the judge.
  const std::string quoted = Json(text).dump(-1, ' ', false, Json::error_handler_t::replace);
  if (Json::parse(quoted).get<std::string>() != text)
    fail(document, place, pointer, "the text is not UTF-8", "write it in UTF-8");
  return node;
}

}  // namespace piecework::scene
