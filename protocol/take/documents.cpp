#include "protocol/take/documents.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "protocol/base/text.h"
#include "protocol/strict_json.h"

namespace nodal::take {
namespace {

using Json = nlohmann::json;

/// A field of an object; errors name the file and the field.
class JsonFields {
 public:
  JsonFields(const Json& json, std::string where) : json_(json), where_(std::move(where)) {}

  Result<std::uint64_t> number(const char* key, std::uint64_t most) const {
    const auto at = json_.find(key);
    if (at == json_.end()) return missing(key);
    if (!at->is_number_unsigned() || at->get<std::uint64_t>() > most)
      return wrong(key, fmt::format("not a number from 0 to {}", most));
    return at->get<std::uint64_t>();
  }
  Result<std::string> text(const char* key, std::size_t most) const {
    const auto at = json_.find(key);
    if (at == json_.end()) return missing(key);
    if (!at->is_string() || at->get_ref<const std::string&>().size() > most ||
        !is_printable(at->get_ref<const std::string&>())) {
      return wrong(key, fmt::format("not a text of at most {} bytes", most));
    }
    return at->get<std::string>();
  }
  Result<const Json*> list(const char* key, std::size_t most) const {
    const auto at = json_.find(key);
    if (at == json_.end()) return missing(key);
    if (!at->is_array() || at->size() > most) return wrong(key, fmt::format("not a list of at most {}", most));
    return &*at;
  }
  tl::unexpected<Error> wrong(const char* key, const std::string& how) const {
    return fail(Errc::kBadValue, fmt::format("{}: {}: {}", where_, key, how));
  }

 private:
  tl::unexpected<Error> missing(const char* key) const {
    return fail(Errc::kMissingField, fmt::format("{}: {} is missing", where_, key));
  }
  const Json& json_;
  const std::string where_;
};

Result<Json> parse(std::string_view text, const std::string& file, std::size_t limit) {
  auto json = parse_strict_json(text, {.bytes = limit, .depth = 8});
  if (!json) return fail(json.error().in(file));
  if (!json->is_object()) return fail(Errc::kBadFormat, file + ": not a JSON object");
  const auto version = JsonFields(*json, file).number("version", UINT32_MAX);
  if (!version) return fail(version.error());
  if (*version != static_cast<std::uint64_t>(kTakeVersion)) {
    return fail(Errc::kFutureVersion,
                fmt::format("{}: version {}; this program knows {}", file, *version, kTakeVersion));
  }
  return json;
}

/// Takes a value out of a Result, or ends the parser with its error.
#define NODAL_TAKE(variable, result)                              \
  auto variable##_result = (result);                              \
  if (!variable##_result) return fail(variable##_result.error()); \
  auto& variable = *variable##_result

constexpr std::uint64_t kMostNs = INT64_MAX;
constexpr std::size_t kMostFiles = 200'000;

}  // namespace

std::string take_json(const TakeDocument& take) {
  nlohmann::ordered_json json{{"take", take.number},
                              {"version", kTakeVersion},
                              {"rig", take.rig},
                              {"software", take.software},
                              {"started_utc_ns", take.started_utc_ns},
                              {"rate", {take.rate.numerator, take.rate.denominator}},
                              {"mode", take.mode},
                              {"calibration", take.calibration_id},
                              {"layout", take.layout},
                              {"raymap", {take.raymap_width, take.raymap_height}},
                              {"heads", take.heads}};
  return json.dump(2) + "\n";
}

Result<TakeDocument> parse_take_json(std::string_view text, const std::string& file) {
  NODAL_TAKE(json, parse(text, file, kMaxTakeJsonBytes));
  const JsonFields fields(json, file);
  TakeDocument take;
  NODAL_TAKE(number, fields.number("take", kMostNs));
  NODAL_TAKE(rig, fields.text("rig", 256));
  NODAL_TAKE(software, fields.text("software", 256));
  NODAL_TAKE(started, fields.number("started_utc_ns", kMostNs));
  NODAL_TAKE(rate, fields.list("rate", 2));
  NODAL_TAKE(mode, fields.text("mode", 32));
  NODAL_TAKE(calibration, fields.text("calibration", 64));
  NODAL_TAKE(layout, fields.text("layout", 256));
  NODAL_TAKE(raymap, fields.list("raymap", 2));
  NODAL_TAKE(heads, fields.list("heads", kMaxHeads));
  if (rate->size() != 2 || !(*rate)[0].is_number_unsigned() || !(*rate)[1].is_number_unsigned()) {
    return fields.wrong("rate", "not two numbers");
  }
  const auto valid = FrameRate::make((*rate)[0].get<std::uint64_t>(), (*rate)[1].get<std::uint64_t>());
  if (!valid) return fields.wrong("rate", "not a frame rate");
  constexpr std::uint64_t kMostPixels = 1 << 16;
  for (const Json& side : *raymap) {
    if (raymap->size() != 2 || !side.is_number_unsigned() || side.get<std::uint64_t>() > kMostPixels)
      return fields.wrong("raymap", "not a width and a height");
  }
  for (const Json& head : *heads) {
    if (!head.is_string() || head.get_ref<const std::string&>().size() > 256 ||
        !is_printable(head.get_ref<const std::string&>())) {
      return fields.wrong("heads", "not a list of names");
    }
    take.heads.push_back(head.get<std::string>());
  }
  take.number = number;
  take.rig = rig;
  take.software = software;
  take.started_utc_ns = static_cast<std::int64_t>(started);
  take.rate = *valid;
  take.mode = mode;
  take.calibration_id = calibration;
  take.layout = layout;
  if (raymap->size() == 2) {
    take.raymap_width = (*raymap)[0].get<int>();
    take.raymap_height = (*raymap)[1].get<int>();
  }
  return take;
}

std::uint64_t Manifest::bytes() const {
  std::uint64_t sum = 0;
  for (const File& file : files) sum += file.bytes;
  return sum;
}

std::string manifest_json(const Manifest& manifest) {
  nlohmann::ordered_json json{{"take", manifest.number},
                              {"version", kTakeVersion},
                              {"sets", manifest.sets},
                              {"lost_sets", manifest.lost_sets},
                              {"deleted_sets", manifest.deleted_sets},
                              {"length_ns", manifest.length.ns()},
                              {"ended", manifest.ended}};
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

Result<Manifest> parse_manifest(std::string_view text, const std::string& file) {
  NODAL_TAKE(json, parse(text, file, kMaxManifestBytes));
  const JsonFields fields(json, file);
  Manifest manifest;
  NODAL_TAKE(number, fields.number("take", kMostNs));
  NODAL_TAKE(sets, fields.number("sets", std::uint64_t{1} << 48));
  NODAL_TAKE(lost, fields.number("lost_sets", std::uint64_t{1} << 48));
  // A nodald that could not delete segments did not write it.
  NODAL_TAKE(deleted, json.contains("deleted_sets") ? fields.number("deleted_sets", std::uint64_t{1} << 48)
                                                    : Result<std::uint64_t>(0));
  NODAL_TAKE(length, fields.number("length_ns", kMostNs));
  NODAL_TAKE(ended, fields.text("ended", 256));
  NODAL_TAKE(marks, fields.list("marks", kMostMarks));
  for (const Json& each : *marks) {
    if (!each.is_object()) return fields.wrong("marks", "not a list of objects");
    const JsonFields entry(each, file + ": marks");
    NODAL_TAKE(set, entry.number("set", std::uint64_t{1} << 48));
    NODAL_TAKE(mark, entry.text("text", kMaxMarkBytes));
    manifest.marks.push_back({set, mark});
  }
  if (json.contains("calibrations")) {
    NODAL_TAKE(calibrations, fields.list("calibrations", kMostCalibrations));
    for (const Json& each : *calibrations) {
      if (!each.is_object()) return fields.wrong("calibrations", "not a list of objects");
      const JsonFields entry(each, file + ": calibrations");
      NODAL_TAKE(name, entry.text("file", 64));
      NODAL_TAKE(id, entry.text("id", 64));
      NODAL_TAKE(set, entry.number("set", kMostNs));
      Manifest::Calibration calibration{name, id, set};
      if (const Status good = check_next(calibration, manifest.calibrations); !good) return fail(good.error().in(file));
      manifest.calibrations.push_back(std::move(calibration));
    }
  }
  NODAL_TAKE(files, fields.list("files", kMostFiles));
  std::set<std::string> names;
  for (const Json& each : *files) {
    if (!each.is_object()) return fields.wrong("files", "not a list of objects");
    const JsonFields entry(each, file + ": files");
    NODAL_TAKE(name, entry.text("name", 64));
    NODAL_TAKE(bytes, entry.number("bytes", std::uint64_t{1} << 40));
    NODAL_TAKE(xxh3, entry.text("xxh3", 32));
    const auto digest = xxh128_of_hex(xxh3);
    if (!digest) return entry.wrong("xxh3", "not 32 hexadecimal digits");
    if (!is_take_file(name) || name == kManifestFile)
      return entry.wrong("name", fmt::format("'{}' is no file of a take", name));
    if (!names.insert(name).second) return entry.wrong("name", fmt::format("'{}' is there twice", name));
    manifest.files.push_back({name, bytes, *digest});
  }
  manifest.number = number;
  manifest.sets = sets;
  manifest.lost_sets = lost;
  manifest.deleted_sets = deleted;
  manifest.length = Duration::nanoseconds(static_cast<std::int64_t>(length));
  manifest.ended = ended;
  return manifest;
}

std::string calibration_file(std::size_t number) { return fmt::format("calibration-{:04}.json", number); }

Status check_next(const Manifest::Calibration& calibration, std::span<const Manifest::Calibration> before) {
  const auto is_digit = [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); };
  if (before.size() < kMostCalibrations && calibration.file == calibration_file(before.size() + 1) &&
      calibration.id.size() == 64 && std::ranges::all_of(calibration.id, is_digit) &&
      (before.empty() || before.back().set <= calibration.set)) {
    return {};
  }
  return fail(Errc::kBadValue, fmt::format("calibrations: '{}' from set {} on, as number {}", calibration.file,
                                           calibration.set, before.size() + 1));
}

bool is_take_file(std::string_view name) {
  for (const std::string& each :
       {kTakeFile, kManifestFile, kProtectedFile, kCalibrationFile, kRigFile, kThumbFile, kFlightFile, kDeletedFile}) {
    if (name == each) return true;
  }
  const auto digits = [&](std::size_t least) {
    std::size_t count = 0;
    while (count < name.size() && name[count] >= '0' && name[count] <= '9') ++count;
    name.remove_prefix(count);
    return count >= least && count <= 8;
  };
  const auto word = [&](std::string_view expected) {
    if (!name.starts_with(expected)) return false;
    name.remove_prefix(expected.size());
    return true;
  };
  if (word("cam")) return digits(1) && word("-") && digits(4) && name == ".mkv";
  if (word("calibration-")) return digits(4) && name == ".json";
  if (word("raymap-")) return digits(4) && name == ".mkv";
  return word("evidence-") && digits(4) && name.empty();
}

}  // namespace nodal::take
