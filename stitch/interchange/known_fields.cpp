#include "stitch/interchange/known_fields.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>

#include "protocol/base/text.h"

namespace nodal::interchange {
namespace {

constexpr std::size_t kMaxNamesInNote = 8;     // unknown fields that a note names
constexpr std::size_t kMaxUnknownKept = 1000;  // unknown fields of a file that are kept; further ones are not counted
constexpr std::size_t kMaxValueInNote = 40;    // bytes

bool matches(const KnownField& field, std::string_view place, std::string_view name) {
  if (field.place != place) return false;
  if (!field.name.ends_with('*') || field.name == "*") return field.name == name || field.name == "*";
  return name.starts_with(field.name.substr(0, field.name.size() - 1));
}

/// The next word of a list such as "[0, 0.5]" or "0 0.5"; shortens `list`.
std::string_view next_word(std::string_view& list) {
  constexpr std::string_view kBetween = " \t,[]";
  list.remove_prefix(std::min(list.find_first_not_of(kBetween), list.size()));
  const std::string_view word = list.substr(0, list.find_first_of(kBetween));
  list.remove_prefix(word.size());
  return word;
}

bool same_word(std::string_view a, std::string_view b) {
  double x = 0, y = 0;
  const auto number = [](std::string_view word, double& value) {
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    return error == std::errc() && end == word.data() + word.size();
  };
  return number(a, x) && number(b, y) ? x == y : a == b;
}

bool same_value(std::string_view value, std::string_view neutral) {
  if (neutral.size() == 2 && neutral[1] == '*') return value.find_first_not_of(neutral[0]) == std::string_view::npos;
  constexpr std::string_view kAll = "...";
  const bool all = neutral.ends_with(kAll);
  if (all) neutral.remove_suffix(kAll.size());
  while (true) {
    std::string_view rest = neutral;
    const std::string_view a = next_word(value), b = next_word(all ? rest : neutral);
    if (all && a.empty()) return true;
    if (!same_word(a, b)) return false;
    if (a.empty()) return true;
  }
}

bool is_neutral(const KnownField& field, std::string_view value) {
  if (field.neutral.empty()) return false;
  std::string_view rest = field.neutral;
  while (true) {
    const std::size_t bar = std::min(rest.find('|'), rest.size());
    if (same_value(value, rest.substr(0, bar))) return true;
    if (bar == rest.size()) return false;
    rest.remove_prefix(bar + 1);
  }
}

/// "head 'a'", "head 'a' and 3 others", or nothing.
std::string owners(const std::string& whose, std::size_t count) {
  const std::size_t others = count - 1;
  if (whose.empty() || others == 0) return whose;
  return fmt::format("{} and {}{}", whose, others, others == 1 ? " other" : " others");
}

}  // namespace

void FieldCheck::see(std::string_view place, std::string_view name, std::string_view value, const std::string& whose) {
  const auto add = [&](Seen& seen) {
    if (seen.count++ == 0) {
      seen.name = printable(name, kMaxValueInNote);
      seen.value = printable(value, kMaxValueInNote);
    }
    if (seen.whose.empty()) seen.whose = whose;
  };
  const auto known = std::ranges::find_if(format_.fields, [&](const KnownField& f) { return matches(f, place, name); });
  if (known == format_.fields.end()) {
    const std::string key = std::string(place) + '\0' + std::string(name);
    if (unknown_.size() < kMaxUnknownKept || unknown_.contains(key)) add(unknown_[key]);
    return;
  }
  const bool tell = known->use == FieldUse::kNoted || known->use == FieldUse::kRefused;
  if (tell && !is_neutral(*known, value)) add(left_out_[&*known]);
}

Status FieldCheck::tell(std::vector<std::string>& notes) const {
  for (const KnownField& field : format_.fields) {
    const auto found = left_out_.find(&field);
    if (found == left_out_.end()) continue;
    const Seen& seen = found->second;
    const std::string of = owners(seen.whose, seen.count);
    const std::string text =
        "'" + seen.name + "'" + (seen.value.empty() ? "" : " = " + seen.value) + (of.empty() ? "" : " of " + of);
    if (field.use == FieldUse::kRefused) return fail(Errc::kUnsupported, text + ": " + std::string(field.meaning));
    notes.push_back("Left out: " + text + ", " + std::string(field.meaning) + ".");
  }
  if (unknown_.empty()) return {};
  std::string names;
  std::size_t named = 0;
  for (const auto& [key, seen] : unknown_) {
    if (named == kMaxNamesInNote) break;
    const std::string of = owners(seen.whose, seen.count);
    const std::string place = key.substr(0, key.find('\0'));
    names +=
        std::string(named++ == 0 ? "" : ", ") + "'" + seen.name + "' (" + place + (of.empty() ? "" : " of ") + of + ")";
  }
  if (unknown_.size() > named) names += fmt::format(" and {} more", unknown_.size() - named);
  notes.push_back("Not known to Nodal in a file of " + std::string(format_.program) + ", and left out: " + names + ".");
  return {};
}

std::span<const KnownFormat* const> known_formats() {
  static const std::array<const KnownFormat*, 7> kAll{&hugin_fields(),       &ptgui_fields(),  &videostitch_fields(),
                                                      &surround360_fields(), &opencv_fields(), &kalibr_fields(),
                                                      &ocam_fields()};
  return kAll;
}

}  // namespace nodal::interchange
