#include "functions.h"

#include <algorithm>
#include <cctype>
#include <map>
#include <regex>
#include <string_view>

namespace nodal::tidy {
namespace {

/// The text without comments; literals' contents become blanks of the same length, so that their braces do not count.
struct Code {
  std::string text;      ///< comments blanked
  std::string brackets;  ///< literals blanked as well
};

bool is_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }

std::size_t end_of_literal(const std::string& text, std::size_t at) {
  const char quote = text[at];
  for (std::size_t i = at + 1; i < text.size(); ++i) {
    if (text[i] == '\\') {
      ++i;
    } else if (text[i] == quote || text[i] == '\n') {
      return i;
    }
  }
  return text.size();
}

void blank(std::string& text, std::size_t from, std::size_t to) {
  for (std::size_t i = from; i < std::min(to, text.size()); ++i) {
    if (text[i] != '\n') text[i] = ' ';
  }
}

Code code_of(const TextFile& file) {
  Code code;
  for (const std::string& line : file.lines) code.text += line + "\n";
  code.brackets = code.text;
  for (std::size_t i = 0; i < code.text.size();) {
    const std::string_view rest = std::string_view(code.text).substr(i);
    if (rest.starts_with("//") || rest.starts_with("/*")) {
      const bool line = rest[1] == '/';
      const std::size_t end = std::min(code.text.find(line ? "\n" : "*/", i), code.text.size()) + (line ? 0 : 2);
      blank(code.text, i, end);
      blank(code.brackets, i, end);
      i = end;
    } else if (rest[0] == '"' || (rest[0] == '\'' && (i == 0 || !is_word(code.text[i - 1])))) {
      const std::size_t end = end_of_literal(code.text, i);
      blank(code.brackets, i, end + 1);
      i = end + 1;
    } else {
      ++i;
    }
  }
  return code;
}

/// Whether a brace after this text opens a function: after a parameter list and specifiers, not a control statement.
bool opens_function(const std::string& text, std::size_t brace) {
  constexpr std::size_t kLongestHead = 400;  // characters; the longest signatures have half as many
  const std::size_t from = brace > kLongestHead ? brace - kLongestHead : 0;
  const std::string head = text.substr(from, brace - from);
  std::size_t at = head.rfind(')');
  if (at == std::string::npos) return false;
  static const std::regex tail(R"(\s*((const|noexcept|override|final|mutable)\s*)*(->[^;(){}]*)?)");
  if (!std::regex_match(head.substr(at + 1), tail)) return false;
  for (int depth = 0;; --at) {
    depth += head[at] == ')' ? 1 : head[at] == '(' ? -1 : 0;
    if (depth == 0 || at == 0) break;
  }
  static const std::regex statement(R"(\b(if|for|while|switch|catch|constexpr)\s*$)");
  return !std::regex_search(head.substr(0, at), statement);
}

std::string shape_of(const std::string& body) {
  std::map<std::string, std::size_t> names;
  std::string shape;
  for (std::size_t i = 0; i < body.size();) {
    if (!is_word(body[i])) {
      if (body[i] != ' ') shape += body[i];
      ++i;
      continue;
    }
    std::size_t end = i;
    while (end < body.size() && is_word(body[end])) ++end;
    const std::string word = body.substr(i, end - i);
    const bool number = std::isdigit(static_cast<unsigned char>(word[0])) != 0;
    shape += number ? word : "$" + std::to_string(names.try_emplace(word, names.size()).first->second);
    shape += ' ';
    i = end;
  }
  return shape;
}

std::string one_blank(const std::string& text) {
  static const std::regex blanks(R"(\s+)");
  return std::regex_replace(text, blanks, " ");
}

std::size_t lines_between(const std::string& text, std::size_t from, std::size_t to) {
  std::size_t lines = 0;
  bool any = false;
  for (std::size_t i = text.find('\n', from); i < to; ++i) {
    if (text[i] == '\n') {
      lines += any ? 1 : 0;
      any = false;
    } else if (text[i] != ' ') {
      any = true;
    }
  }
  return lines;
}

}  // namespace

std::string brackets_of(const TextFile& file) { return code_of(file).brackets; }

std::vector<Function> functions_in(const TextFile& file) {
  const Code code = code_of(file);
  std::vector<Function> functions;
  std::vector<std::size_t> open;
  for (std::size_t i = 0; i < code.brackets.size(); ++i) {
    if (code.brackets[i] == '{') open.push_back(i);
    if (code.brackets[i] != '}' || open.empty()) continue;
    const std::size_t from = open.back();
    open.pop_back();
    if (!opens_function(code.brackets, from)) continue;
    Function function;
    function.file = file.path;
    function.line = 1 + static_cast<std::size_t>(
                            std::count(code.text.begin(), code.text.begin() + static_cast<std::ptrdiff_t>(from), '\n'));
    function.lines = lines_between(code.text, from + 1, i);
    function.body = one_blank(code.text.substr(from, i + 1 - from));
    function.shape = shape_of(function.body);
    functions.push_back(std::move(function));
  }
  return functions;
}

std::vector<std::string> repeated_functions(const std::vector<TextFile>& files, std::size_t lines_alike,
                                            std::size_t lines_renamed) {
  std::map<std::string, Function> bodies, shapes;
  std::vector<std::string> repeated;
  const auto place = [](const Function& f) { return f.file + ":" + std::to_string(f.line); };
  for (const TextFile& file : files) {
    if (!is_source(file.path)) continue;
    for (const Function& function : functions_in(file)) {
      const auto [alike, new_body] = bodies.try_emplace(function.body, function);
      const auto [renamed, new_shape] = shapes.try_emplace(function.shape, function);
      if (!new_body && function.lines >= lines_alike) {
        repeated.push_back(place(function) + " has the same body as " + place(alike->second));
      } else if (!new_shape && function.lines >= lines_renamed) {
        repeated.push_back(place(function) + " has, but for names, the body of " + place(renamed->second));
      }
    }
  }
  return repeated;
}

}  // namespace nodal::tidy
