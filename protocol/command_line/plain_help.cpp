#include "protocol/command_line/plain_help.h"

#include <algorithm>

namespace nodal {
namespace {

/// " (1 to 256)" for an option's type "N:INT in [1 - 256]"; empty if there is no range.
std::string range_of(const std::string& type) {
  const std::size_t begin = type.find(" in [");
  const std::size_t between = type.find(" - ", begin);
  const std::size_t end = type.find(']', between);
  if (begin == std::string::npos || between == std::string::npos || end == std::string::npos) return "";
  return " (" + type.substr(begin + 5, between - begin - 5) + " to " + type.substr(between + 3, end - between - 3) +
         ")";
}

/// Cuts what begins with " Excludes:" or " Needs:"; descriptions say it where it matters, and errors name both options.
void cut_from(std::string& text, const std::string& heading) {
  text.resize(std::min(text.size(), text.rfind(" " + heading + ":")));
}

}  // namespace

std::string type_of(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  return type.substr(0, type.find(':'));
}

std::string PlainHelp::make_option_opts(const CLI::Option* option) const {
  std::string text = CLI::Formatter::make_option_opts(option);
  const std::string whole = option->get_type_name();
  if (const std::size_t at = whole.empty() ? std::string::npos : text.find(whole); at != std::string::npos) {
    text.replace(at, whole.size(), type_of(*option) + range_of(whole));
  }
  cut_from(text, get_label("Excludes"));
  cut_from(text, get_label("Needs"));
  return text;
}

}  // namespace nodal
