#include "firmware/daemon/rig_reference.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <regex>
#include <utility>

#include "protocol/base/fit_text.h"
#include "protocol/base/nearest_word.h"
#include "protocol/base/text.h"

namespace nodal::daemon {
namespace {

constexpr std::size_t kMaxKey = 64;  // characters of a key that an error repeats

/// A heading of the text with what stands below it, up to the next heading.
struct Part {
  std::vector<std::string> names;  ///< "takes" or "takes.mode"; empty for headings that are no part of rig.toml
  bool section = false;
  std::vector<std::string> lines;
};

/// The names of a heading such as "raymap.width, raymap.height". Other headings begin with a capital letter.
std::vector<std::string> names_in(std::string_view heading) {
  std::vector<std::string> names;
  if (heading.empty() || std::islower(static_cast<unsigned char>(heading.front())) == 0) return names;
  constexpr std::string_view kBetween = ", ";
  for (std::size_t from = 0; from < heading.size();) {
    const std::size_t to = std::min(heading.find(kBetween, from), heading.size());
    names.emplace_back(heading.substr(from, to - from));
    from = to + kBetween.size();
  }
  return names;
}

std::vector<Part> parts_of(std::string_view text) {
  std::vector<Part> parts;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.starts_with("## ")) {
      parts.push_back({names_in(line.substr(3)), true, {}});
    } else if (line.starts_with("### ")) {
      parts.push_back({names_in(line.substr(4)), false, {}});
    } else if (!parts.empty()) {
      parts.back().lines.emplace_back(line);
    }
  }
  return parts;
}

/// [text](target) becomes text.
std::string without_links(const std::string& line) {
  static const std::regex link(R"(\[([^\[\]]+)\]\([^)]*\))");
  return std::regex_replace(line, link, "$1");
}

/// Paragraphs and list items as lines of kLineWidth characters; code, which is indented by four, stays as it is.
std::string wrapped_text(const std::vector<std::string>& lines) {
  std::string text, paragraph;
  const auto flush = [&] {
    const bool item = paragraph.starts_with("- ");
    bool first = true;
    for (const std::string& line : wrapped(paragraph, kLineWidth - (item ? 2 : 0))) {
      text += (item && !first ? "  " : "") + line + '\n';
      first = false;
    }
    paragraph.clear();
  };
  for (const std::string& line : lines) {
    const bool code = line.starts_with("    ");
    if (line.empty() || code || line.starts_with("- ")) flush();
    if (line.empty() || code) {
      text += line + '\n';
      continue;
    }
    const std::size_t indent = line.find_first_not_of(' ');
    paragraph += (paragraph.empty() ? "" : " ") + without_links(line.substr(indent));
  }
  flush();
  while (text.ends_with("\n\n")) text.pop_back();
  text.erase(0, std::min(text.find_first_not_of('\n'), text.size()));
  return text;
}

/// The first sentence of a part, for a list of keys.
std::string first_sentence(const Part& part) {
  const std::string text = wrapped_text(part.lines);
  std::string sentence = text.substr(0, std::min(text.find("\n\n"), text.find("\n- ")));
  std::ranges::replace(sentence, '\n', ' ');
  sentence = sentence.substr(0, sentence.find(". "));
  while (sentence.ends_with(' ') || sentence.ends_with('.')) sentence.pop_back();
  return sentence;
}

std::string joined(const std::vector<std::string>& names, std::string_view between) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : std::string(between)) + name;
  return text;
}

/// "[takes]", "[[heads]]" and "heads[3].port", as they stand in rig.toml and in errors, as "takes", "heads",
/// "heads.port".
std::string plain(std::string_view key) {
  static const std::regex index(R"(\[\d+\])");
  std::string name = std::regex_replace(printable(key, kMaxKey), index, "");
  std::erase_if(name, [](char c) { return c == '[' || c == ']'; });
  return name;
}

std::string section_text(const std::vector<Part>& parts, const Part& section) {
  std::string text = fmt::format("[{}]\n\n{}", section.names.front(), wrapped_text(section.lines));
  if (!section.lines.empty() && !text.ends_with("\n\n")) text += '\n';
  std::vector<std::pair<std::string, std::string>> rows;
  std::size_t width = 0;
  for (const Part& part : parts) {
    if (part.section || part.names.empty() || !part.names.front().starts_with(section.names.front() + ".")) continue;
    rows.emplace_back(joined(part.names, ", "), first_sentence(part));
    width = std::max(width, rows.back().first.size());
  }
  std::string keys;
  for (const auto& [key, sentence] : rows) keys += fmt::format("  {:<{}}  {}\n", key, width, sentence);
  return text + "Keys:\n" + fitted(keys);
}

std::string key_text(const Part& part) { return joined(part.names, ", ") + "\n\n" + wrapped_text(part.lines); }

}  // namespace

std::vector<std::string> explained_keys(std::string_view reference) {
  std::vector<std::string> keys;
  for (const Part& part : parts_of(reference)) {
    if (!part.section) keys.insert(keys.end(), part.names.begin(), part.names.end());
  }
  return keys;
}

Result<std::string> explain(std::string_view reference, std::string_view key) {
  const std::vector<Part> parts = parts_of(reference);
  const std::string name = plain(key);
  std::vector<std::string> known, sections;
  std::string exact, similar;
  for (const Part& part : parts) {
    known.insert(known.end(), part.names.begin(), part.names.end());
    if (part.section) sections.insert(sections.end(), part.names.begin(), part.names.end());
    for (const std::string& one : part.names) {
      if (one == name) exact = part.section ? section_text(parts, part) : key_text(part);
      if (one.ends_with("." + name)) similar += (similar.empty() ? "" : "\n") + key_text(part);
    }
  }
  if (!exact.empty()) return exact;
  if (!similar.empty()) return similar;
  const std::vector<std::string_view> words(known.begin(), known.end());
  const std::string_view near = nearest_word(name, words);
  return fail(Errc::kNotFound,
              fmt::format("rig.toml has no key '{}'; {}", name,
                          near.empty() ? "give a key such as takes.mode, or a section: " + joined(sections, ", ")
                                       : fmt::format("did you mean '{}'?", near)));
}

}  // namespace nodal::daemon
