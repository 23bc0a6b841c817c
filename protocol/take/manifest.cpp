#include <fmt/format.h>

#include <algorithm>
#include <ranges>
#include <utility>
#include <vector>

#include "protocol/base/try.h"
#include "protocol/take/documents.h"
#include "protocol/take/json_fields.h"
#include "protocol/take/limits.h"

namespace nodal::take {
namespace {

constexpr auto kMaxNs = static_cast<std::uint64_t>(kMaxTimeNs);

/// gaps, heads and rates of a manifest. A nodald of before did not write them.
Status parse_tally(const Json& json, const std::string& file, Manifest& manifest) {
  const JsonFields fields(json, file);
  if (json.contains("gaps")) {
    if (!json["gaps"].is_object()) return fields.wrong("gaps", "not an object");
    const JsonFields entry(json["gaps"], file + ": gaps");
    NODAL_TAKE(count, entry.number("count", kMaxSets));
    NODAL_TAKE(slow, entry.number("slow", kMaxSets));
    NODAL_TAKE(error, entry.number("error", kMaxSets));
    NODAL_TAKE(capture, entry.number("capture", kMaxSets));
    NODAL_TAKE(longest, entry.number("longest_ns", kMaxNs));
    NODAL_TAKE(before, entry.number("longest_before", kMaxSets));
    manifest.gaps = {count, slow, error, capture, Duration::nanoseconds(static_cast<std::int64_t>(longest)), before};
  }
  if (json.contains("heads")) {
    NODAL_TAKE(heads, fields.list("heads", kMaxHeads));
    for (const Json& each : *heads) {
      if (!each.is_object()) return fields.wrong("heads", "not a list of objects");
      const JsonFields entry(each, file + ": heads");
      NODAL_TAKE(missing, entry.number("missing", kMaxSets));
      NODAL_TAKE(format, entry.number("format", kMaxSets));
      NODAL_TAKE(encoder, entry.number("encoder", kMaxSets));
      manifest.heads.push_back({missing, format, encoder});
    }
  }
  if (json.contains("rates")) {
    NODAL_TAKE(rates, fields.list("rates", kMaxRates));
    for (const Json& each : *rates) {
      if (!each.is_object() || !each.contains("rate")) return fields.wrong("rates", "not a list of rates");
      const JsonFields entry(each, file + ": rates");
      NODAL_TAKE(set, entry.number("set", kMaxSets));
      NODAL_TAKE(rate, rate_in(each["rate"], entry));
      manifest.rates.push_back({set, rate});
    }
  }
  return {};
}

}  // namespace

std::vector<std::uint32_t> Manifest::segments() const {
  return segments_among(std::views::transform(files, &File::name));
}

std::uint64_t Manifest::bytes() const {
  std::uint64_t sum = 0;
  for (const File& file : files) sum += file.bytes;
  return sum;
}

Manifest within_limits(Manifest manifest) {
  for (std::uint64_t* const each : {&manifest.sets, &manifest.lost_sets, &manifest.deleted_sets})
    *each = std::min(*each, kMaxSets);
  manifest.length = std::clamp(manifest.length, Duration(), Duration::nanoseconds(kMaxTimeNs));
  manifest.ended = printable(manifest.ended, kMaxTakeTextBytes);
  if (manifest.marks.size() > kMaxMarks) manifest.marks.resize(kMaxMarks);
  for (Manifest::Mark& mark : manifest.marks) {
    mark.set = std::min(mark.set, kMaxSets);
    mark.text = printable(mark.text, kMaxMarkBytes);
  }
  manifest.gaps.longest = std::clamp(manifest.gaps.longest, Duration(), Duration::nanoseconds(kMaxTimeNs));
  if (manifest.rates.size() > kMaxRates) manifest.rates.resize(kMaxRates);
  return manifest;
}

std::string manifest_json(const Manifest& manifest) {
  nlohmann::ordered_json json{{"take", manifest.number},
                              {"version", kTakeVersion},
                              {"sets", manifest.sets},
                              {"lost_sets", manifest.lost_sets},
                              {"deleted_sets", manifest.deleted_sets},
                              {"length_ns", manifest.length.ns()},
                              {"ended", manifest.ended},
                              {"gaps",
                               {{"count", manifest.gaps.count},
                                {"slow", manifest.gaps.slow},
                                {"error", manifest.gaps.error},
                                {"capture", manifest.gaps.capture},
                                {"longest_ns", manifest.gaps.longest.ns()},
                                {"longest_before", manifest.gaps.longest_before}}}};
  nlohmann::ordered_json heads = nlohmann::ordered_json::array(), rates = nlohmann::ordered_json::array();
  for (const HeadGaps& head : manifest.heads)
    heads.push_back({{"missing", head.missing}, {"format", head.format}, {"encoder", head.encoder}});
  for (const RateChange& each : manifest.rates) rates.push_back({{"set", each.set}, {"rate", rate_json(each.rate)}});
  json["heads"] = std::move(heads);
  json["rates"] = std::move(rates);
  nlohmann::ordered_json files = nlohmann::ordered_json::array();
  for (const Manifest::File& file : manifest.files) {
    files.push_back({{"name", file.name}, {"bytes", file.bytes}, {"xxh3", to_hex(file.digest)}});
  }
  nlohmann::ordered_json marks = nlohmann::ordered_json::array();
  for (const Manifest::Mark& mark : manifest.marks) marks.push_back({{"set", mark.set}, {"text", mark.text}});
  json["marks"] = std::move(marks);
  if (!manifest.calibrations.empty()) {
    nlohmann::ordered_json calibrations = nlohmann::ordered_json::array();
    for (const Manifest::Calibration& each : manifest.calibrations)
      calibrations.push_back({{"file", each.file}, {"id", each.id}, {"set", each.set}});
    json["calibrations"] = std::move(calibrations);
  }
  json["files"] = std::move(files);
  return json.dump(1) + "\n";
}

namespace {

/// Takes the elements of a manifest's lists, one after the other. The first error is kept.
class ManifestLists {
 public:
  ManifestLists(Manifest& into, const std::string& file) : into_(into), file_(file) {}

  void mark(const Json& json) {
    add(json, "marks", [&](const JsonFields& entry) -> Status {
      if (into_.marks.size() == kMaxMarks) return too_many("marks", kMaxMarks);
      NODAL_TAKE(set, entry.number("set", kMaxSets));
      NODAL_TAKE(text, entry.text("text", kMaxMarkBytes));
      into_.marks.push_back({set, text});
      return {};
    });
  }
  void calibration(const Json& json) {
    add(json, "calibrations", [&](const JsonFields& entry) -> Status {
      NODAL_TAKE(name, entry.text("file", 64));
      NODAL_TAKE(id, entry.text("id", 64));
      NODAL_TAKE(set, entry.number("set", UINT64_MAX));  // by the rig's count, which any number may be
      Manifest::Calibration calibration{name, id, set};
      if (const Status good = check_next(calibration, into_.calibrations); !good) return fail(good.error().in(file_));
      into_.calibrations.push_back(std::move(calibration));
      return {};
    });
  }
  void file(const Json& json) {
    add(json, "files", [&](const JsonFields& entry) -> Status {
      if (into_.files.size() == kMaxTakeFiles) return too_many("files", kMaxTakeFiles);
      NODAL_TAKE(name, entry.text("name", 64));
      NODAL_TAKE(bytes, entry.number("bytes", std::uint64_t{1} << 40));
      NODAL_TAKE(xxh3, entry.text("xxh3", 32));
      const auto digest = xxh128_of_hex(xxh3);
      if (!digest) return entry.wrong("xxh3", "not 32 hexadecimal digits");
      if (!is_take_file(name) || name == kManifestFile)
        return entry.wrong("name", fmt::format("'{}' is no file of a take", name));
      into_.files.push_back({name, bytes, *digest});
      return {};
    });
  }

  /// Errors: of an element; kBadValue for a file that is listed twice.
  Status finish() const {
    if (!status_) return status_;
    std::vector<std::string_view> names;
    for (const Manifest::File& each : into_.files) names.emplace_back(each.name);
    std::ranges::sort(names);
    const auto twice = std::ranges::adjacent_find(names);
    if (twice == names.end()) return {};
    return fail(Errc::kBadValue, fmt::format("{}: files: name: '{}' is there twice", file_, *twice));
  }

 private:
  template <class Read>
  void add(const Json& json, const char* list, Read read) {
    if (!status_) return;
    if (!json.is_object()) {
      status_ = fail(Errc::kBadValue, fmt::format("{}: {}: not a list of objects", file_, list));
    } else {
      status_ = read(JsonFields(json, fmt::format("{}: {}", file_, list)));
    }
  }
  Status too_many(const char* list, std::size_t most) const {
    return fail(Errc::kBadValue, fmt::format("{}: {}: not a list of at most {}", file_, list, most));
  }

  Manifest& into_;
  const std::string& file_;
  Status status_;
};

}  // namespace

Result<Manifest> parse_manifest(const TextPieces& text, const std::string& file) {
  Manifest manifest;
  ManifestLists lists(manifest, file);
  const JsonShape value = JsonShape::value(256);
  const JsonShape mark = JsonShape::object({{"set", value}, {"text", value}});
  const JsonShape calibration = JsonShape::object({{"file", value}, {"id", value}, {"set", value}});
  const JsonShape each_file = JsonShape::object({{"name", value}, {"bytes", value}, {"xxh3", value}});
  const JsonShape gaps = JsonShape::object({{"count", value},
                                            {"slow", value},
                                            {"error", value},
                                            {"capture", value},
                                            {"longest_ns", value},
                                            {"longest_before", value}});
  const JsonShape head = JsonShape::object({{"missing", value}, {"format", value}, {"encoder", value}});
  const JsonShape each_rate = JsonShape::object({{"set", value}, {"rate", JsonShape::list(2, value)}});
  const JsonShape shape = JsonShape::object(
      {{"version", value},
       {"take", value},
       {"sets", value},
       {"lost_sets", value},
       {"deleted_sets", value},
       {"length_ns", value},
       {"ended", value},
       {"gaps", gaps},
       {"heads", JsonShape::list(kMaxHeads, head)},
       {"rates", JsonShape::list(kMaxRates, each_rate)},
       {"marks", JsonShape::stream(mark, [&](const Json& json) { lists.mark(json); })},
       {"calibrations", JsonShape::stream(calibration, [&](const Json& json) { lists.calibration(json); })},
       {"files", JsonShape::stream(each_file, [&](const Json& json) { lists.file(json); })}});
  NODAL_TAKE(json, parse_document(text, file, kMaxManifestBytes, shape));
  const JsonFields fields(json, file);
  NODAL_TAKE(number, fields.number("take", kMaxTakeNumber));
  NODAL_TAKE(sets, fields.number("sets", kMaxSets));
  NODAL_TAKE(lost, fields.number("lost_sets", kMaxSets));
  // A nodald that could not delete segments did not write it.
  NODAL_TAKE(deleted,
             json.contains("deleted_sets") ? fields.number("deleted_sets", kMaxSets) : Result<std::uint64_t>(0));
  NODAL_TAKE(length, fields.number("length_ns", kMaxNs));
  NODAL_TAKE(ended, fields.text("ended", kMaxTakeTextBytes));
  NODAL_TRY(parse_tally(json, file, manifest));
  for (const char* list : {"marks", "calibrations", "files"}) {
    if (list == std::string_view("calibrations") && !json.contains(list)) continue;
    NODAL_TRY(fields.list(list, 0));
  }
  NODAL_TRY(lists.finish());
  manifest.number = number;
  manifest.sets = sets;
  manifest.lost_sets = lost;
  manifest.deleted_sets = deleted;
  manifest.length = Duration::nanoseconds(static_cast<std::int64_t>(length));
  manifest.ended = ended;
  return manifest;
}

Result<Manifest> parse_manifest(std::string_view text, const std::string& file) {
  return parse_manifest(one_piece(text), file);
}

Status check_next(const Manifest::Calibration& calibration, std::span<const Manifest::Calibration> before) {
  const auto is_digit = [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); };
  const bool next = before.size() < kMaxCalibrations && calibration.file == calibration_file(before.size() + 1);
  const bool left_out = !calibration.stored() && before.size() <= kMaxCalibrations;
  if ((next || left_out) && (before.empty() || before.back().stored()) && calibration.id.size() == 64 &&
      std::ranges::all_of(calibration.id, is_digit) && (before.empty() || before.back().set <= calibration.set)) {
    return {};
  }
  return fail(Errc::kBadValue, fmt::format("calibrations: '{}' from set {} on, as number {}", calibration.file,
                                           calibration.set, before.size() + 1));
}

}  // namespace nodal::take
