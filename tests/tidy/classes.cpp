#include "classes.h"

#include <algorithm>
#include <cctype>
#include <regex>

#include "functions.h"

namespace nodal::tidy {
namespace {

/// The text without template arguments.
std::string without_arguments(std::string text) {
  static const std::regex arguments(R"(<[^<>]*>)");
  for (std::string less; (less = std::regex_replace(text, arguments, "")) != text;) text = less;
  return text;
}

bool is_function(const std::string& declaration) {
  static const std::regex function(R"(^[^={]*\(\)|\boperator\b)");
  return std::regex_search(without_arguments(declaration), function);
}

/// How many members a declaration that ends with a semicolon has.
std::size_t members_of(const std::string& declaration) {
  static const std::regex other(R"(^\s*(using|friend|static|static_assert|typedef|template|$))");
  static const std::regex type(R"(^\s*(class|struct|union|enum)\b([^{]*|[^{]*\{\}\s*)$)");
  if (std::regex_search(declaration, other) || std::regex_search(declaration, type)) return 0;
  const std::string names = without_arguments(declaration);
  return 1 + static_cast<std::size_t>(std::ranges::count(names, ','));
}

std::size_t end_of_brackets(const std::string& text, std::size_t from, char open, char close) {
  std::size_t depth = 0;
  for (std::size_t i = from; i < text.size(); ++i) {
    if (text[i] == open) ++depth;
    if (text[i] == close && --depth == 0) return i + 1;
  }
  return text.size();
}

/// Reads the declarations of a class behind its opening brace.
ClassSize size_of(const std::string& text, std::size_t from, std::string name) {
  ClassSize size{std::move(name)};
  bool is_private = true;
  std::string declaration;  // so far; what is in brackets is left out
  const auto end_function = [&] {
    size.private_functions += is_private ? 1 : 0;
    declaration.clear();
  };
  for (std::size_t i = from; i < text.size() && text[i] != '}';) {
    const char c = text[i];
    if (c == '(') {
      i = end_of_brackets(text, i, '(', ')');
      declaration += "()";
    } else if (c == '{') {
      i = end_of_brackets(text, i, '{', '}');
      const std::size_t next = text.find_first_not_of(" \n", i);
      const bool goes_on = next != std::string::npos && std::string(",;{").find(text[next]) != std::string::npos;
      if (is_function(declaration) && !goes_on) end_function();
      else declaration += "{}";
    } else if (c == ';') {
      ++i;
      if (is_function(declaration)) end_function();
      else size.members += members_of(declaration);
      declaration.clear();
    } else {
      static const std::regex label(R"(^\s*(public|private|protected)\s*$)");
      std::smatch found;
      if (c == ':' && std::regex_match(declaration, found, label)) {
        is_private = found[1] == "private";
        declaration.clear();
      } else {
        declaration += c == '\n' ? ' ' : c;
      }
      ++i;
    }
  }
  return size;
}

}  // namespace

std::vector<ClassSize> classes_in(const TextFile& file) {
  const std::string text = brackets_of(file);
  static const std::regex head(R"((enum\s+)?\bclass\s+([\w:]+)\s*(final\s*)?(:[^;{]*)?\{)");
  std::vector<ClassSize> classes;
  for (std::sregex_iterator found(text.begin(), text.end(), head); found != std::sregex_iterator(); ++found) {
    if ((*found)[1].matched) continue;
    classes.push_back(size_of(text, static_cast<std::size_t>(found->position() + found->length()), (*found)[2]));
  }
  return classes;
}

}  // namespace nodal::tidy
