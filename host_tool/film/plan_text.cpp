// The plan as a JSON document, and back.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "host_tool/film/film_plan.h"
#include "protocol/base/sha256.h"
#include "protocol/base/try.h"
#include "stitch/seams/placement.h"
#include "stitch/sets/blend_plan.h"

namespace nodal::film {
namespace {

constexpr const char* kFormat = "nodal film plan 2";
constexpr std::int64_t kMaxTime = std::int64_t{1} << 60;  // sums of two fit 64 bits
constexpr std::int64_t kMaxTrack = 255;
constexpr std::int64_t kMaxPlace = 16384;         // px
constexpr std::int64_t kMaxUnitTerm = INT32_MAX;  // ffmpeg's
constexpr std::size_t kMapPixels = std::size_t{sets::kSeamMapWidth} * sets::kSeamMapWidth / 2;

/// Steps from each value to the next; the first one from 0.
std::vector<std::int64_t> steps_of(const std::vector<std::int64_t>& values) {
  std::vector<std::int64_t> steps;
  std::int64_t before = 0;
  for (const std::int64_t value : values) steps.push_back(value - std::exchange(before, value));
  return steps;
}

/// Pairs of a value and how often it comes; of times, of their differences.
template <class Values>
Json runs_of(const Values& values) {
  Json runs = Json::array();
  for (std::size_t at = 0; at < values.size();) {
    std::size_t end = at;
    while (end < values.size() && values[end] == values[at]) ++end;
    runs.push_back(values[at]);
    runs.push_back(end - at);
    at = end;
  }
  return runs;
}

/// A whole number between these limits; nlohmann's get() would cut off what a type does not hold.
std::int64_t whole(const Json& value, const char* name, std::int64_t min, std::int64_t max) {
  const bool large = value.is_number_unsigned() && value.get<std::uint64_t>() > INT64_MAX;
  if (!value.is_number_integer() || large) throw std::out_of_range(name);
  const auto number = value.get<std::int64_t>();
  if (number < min || number > max) throw std::out_of_range(name);
  return number;
}

double real(const Json& value, const char* name) {
  if (!value.is_number()) throw std::out_of_range(name);
  return value.get<double>();
}

std::vector<std::int64_t> values_of(const Json& runs, const char* name, std::size_t count) {
  if (!runs.is_array() || runs.size() % 2 != 0) throw std::out_of_range(name);
  std::vector<std::int64_t> values;
  for (std::size_t at = 0; at < runs.size(); at += 2) {
    const std::int64_t repeated = whole(runs[at + 1], name, 1, static_cast<std::int64_t>(count - values.size()));
    values.insert(values.end(), static_cast<std::size_t>(repeated), whole(runs[at], name, -kMaxTime, kMaxTime));
  }
  if (values.size() != count) throw std::out_of_range(name);
  return values;
}

/// Values of which no one is below the one before, from runs of their steps.
std::vector<std::int64_t> rising(const Json& runs, const char* name, std::size_t count) {
  std::vector<std::int64_t> values = values_of(runs, name, count);
  for (std::size_t k = 1; k < values.size(); ++k) {
    if (values[k] < 0) throw std::out_of_range(name);
    values[k] += values[k - 1];
    if (values[k] > kMaxTime) throw std::out_of_range(name);
  }
  return values;
}

/// Nesting and fields of objects have limits: writing a tree again takes stack for each level, and a field of an object
/// with keys in order is found by comparing all of them.
Json parse(const std::string& text) {
  constexpr std::size_t kMaxDepth = 24, kMaxFields = 256;
  std::vector<std::size_t> fields;  // counts of the open objects and lists
  bool quoted = false;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const char c = text[at];
    if (c == '"') quoted = !quoted;
    if (quoted && c == '\\') ++at;
    if (quoted) continue;
    if (c == '{' || c == '[') {
      if (fields.size() == kMaxDepth) throw std::out_of_range("it is nested too deep");
      fields.push_back(0);
    }
    if ((c == '}' || c == ']') && !fields.empty()) fields.pop_back();
    if (c == ':' && !fields.empty() && ++fields.back() > kMaxFields) {
      throw std::out_of_range("an object has too many fields");
    }
  }
  return Json::parse(text, nullptr, false);
}

Json to_json(const PlannedHead& head) {
  const FilmFile& film = head.film;
  const Json place = film.place ? Json{film.place->left, film.place->top} : Json(nullptr);
  return Json{{"name", head.name},
              {"film", film.path},
              {"track", film.track},
              {"width", film.width},
              {"height", film.height},
              {"place", place},
              {"format", pixel_format_name(film.format)},
              {"decoded_format", film.decoded_format},
              {"video_range", film.coding.video_range},
              {"bt709", film.coding.bt709},
              {"file_starts", film.file_starts_s},
              {"time_base", {film.time_base.num, film.time_base.den}},
              {"first", film.times.front()},
              {"farthest", head.farthest_s},
              {"clock",
               {{"offset", head.clock.offset_s},
                {"ppm", head.clock.ppm},
                {"sigma", head.clock.sigma_s},
                {"ppm_sigma", head.clock.ppm_sigma},
                {"by", head.clock.by}}},
              {"steps", runs_of(steps_of(head.times))}};
}

PixelFormat format_of(const Json& name) {
  const auto format = pixel_format_named(name.get<std::string>());
  if (!format) throw std::out_of_range("format");
  return *format;
}

PlannedHead head_of(const Json& json, const HeadCalibration& calibrated, std::size_t frames) {
  PlannedHead head;
  head.name = json.at("name").get<std::string>();
  if (head.name != calibrated.name) throw std::out_of_range("heads.name");
  head.farthest_s = real(json.at("farthest"), "heads.farthest");
  const Json& clock = json.at("clock");
  head.clock = {head.name,
                real(clock.at("offset"), "heads.clock"),
                real(clock.at("ppm"), "heads.clock"),
                real(clock.at("sigma"), "heads.clock"),
                real(clock.at("ppm_sigma"), "heads.clock"),
                clock.at("by").get<std::string>()};
  FilmFile& film = head.film;
  film.path = json.at("film").get<std::string>();
  film.track = static_cast<int>(whole(json.at("track"), "heads.track", 0, kMaxTrack));
  // The blend reads as many pixels as the calibration says.
  film.width = static_cast<int>(whole(json.at("width"), "heads.width", calibrated.width, calibrated.width));
  film.height = static_cast<int>(whole(json.at("height"), "heads.height", calibrated.height, calibrated.height));
  if (const Json& place = json.at("place"); !place.is_null()) {
    film.place = FilmFile::Place{static_cast<int>(whole(place.at(0), "heads.place", 0, kMaxPlace)),
                                 static_cast<int>(whole(place.at(1), "heads.place", 0, kMaxPlace))};
  }
  film.format = format_of(json.at("format"));
  film.decoded_format = json.at("decoded_format").get<std::string>();
  film.coding = {json.at("video_range").get<bool>(), json.at("bt709").get<bool>()};
  film.file_starts_s = real(json.at("file_starts"), "heads.file_starts");
  film.time_base = {whole(json.at("time_base").at(0), "heads.time_base", 1, kMaxUnitTerm),
                    whole(json.at("time_base").at(1), "heads.time_base", 1, kMaxUnitTerm)};
  film.times = {whole(json.at("first"), "heads.first", -kMaxTime, kMaxTime)};
  head.times = rising(json.at("steps"), "heads.steps", frames);
  return head;
}

PlannedTake take_of(const Json& json, std::size_t frames) {
  PlannedTake take;
  take.folder = json.at("folder").get<std::string>();
  for (const Json& head : json.at("heads")) take.heads.push_back(head.get<std::string>());
  if (take.heads.empty() || take.heads.size() > kMaxHeads) throw std::out_of_range("take.heads");
  take.farthest_s = real(json.at("farthest"), "take.farthest");
  take.raymaps = rising(json.at("raymaps"), "take.raymaps", frames);
  if (take.raymaps.front() < 0) throw std::out_of_range("take.raymaps");
  return take;
}

PlannedLight light_of(const Json& json, const FilmPlan& plan) {
  constexpr Stops kMaxPlannedStops = 8 * kStop;
  PlannedLight light;
  if (json.is_null()) return light;
  const Json& frames = json.at("frames");
  const auto last = static_cast<std::int64_t>(plan.frames) - 1;
  if (!frames.is_array() || frames.empty()) throw std::out_of_range("light.frames");
  for (const Json& frame : frames) {
    const std::int64_t least = light.frames.empty() ? 0 : static_cast<std::int64_t>(light.frames.back()) + 1;
    light.frames.push_back(static_cast<std::uint64_t>(whole(frame, "light.frames", least, last)));
  }
  const Json& stops = json.at("stops");
  if (!stops.is_array() || stops.size() != plan.heads.size()) throw std::out_of_range("light.stops");
  for (const Json& head : stops) {
    if (!head.is_array() || head.size() != light.frames.size()) throw std::out_of_range("light.stops");
    std::vector<Stops>& own = light.stops.emplace_back();
    for (const Json& one : head)
      own.push_back(static_cast<Stops>(whole(one, "light.stops", -kMaxPlannedStops, kMaxPlannedStops)));
  }
  return light;
}

std::vector<PlannedSeams> seams_of(const Json& json, const FilmPlan& plan) {
  std::vector<PlannedSeams> all;
  std::int64_t next = 0;
  for (const Json& one : json) {
    const auto last = static_cast<std::int64_t>(plan.segments()) - 1;
    const std::int64_t segment = whole(one.at("segment"), "seams.segment", next, last);
    next = segment + 1;
    PlannedSeams placed{static_cast<std::uint64_t>(segment), {}};
    placed.labels.reserve(kMapPixels);
    for (const std::int64_t label : values_of(one.at("labels"), "seams.labels", kMapPixels)) {
      const std::size_t heads = plan.take ? plan.take->heads.size() : plan.heads.size();
      const bool known = label >= 0 && label < static_cast<std::int64_t>(heads);
      if (!known && label != seams::kNobody) throw std::out_of_range("seams.labels");
      placed.labels.push_back(static_cast<std::uint8_t>(label));
    }
    all.push_back(std::move(placed));
  }
  return all;
}

FilmPlan read(const Json& json) {
  FilmPlan plan;
  plan.request = json.at("request");
  const Json& take = json.at("take");
  if (take.is_null()) {
    auto calibration = parse_calibration(json.at("calibration").dump());
    if (!calibration) throw std::out_of_range(calibration.error().message);
    plan.calibration = std::move(*calibration);
  }
  const Json& raymap = json.at("raymap");
  plan.raymap.layout = raymap.at("layout").get<std::string>();
  plan.raymap.width = static_cast<int>(whole(raymap.at("width"), "raymap.width", 1, INT32_MAX));
  plan.raymap.height = static_cast<int>(whole(raymap.at("height"), "raymap.height", 1, INT32_MAX));
  plan.raymap.format = format_of(raymap.at("format"));
  plan.raymap.transition = static_cast<Transition>(whole(raymap.at("transition"), "raymap.transition", 0, 2));
  plan.raymap.seam_width_deg = real(raymap.at("seam_width"), "raymap.seam_width");
  plan.raymap.feather = real(raymap.at("feather"), "raymap.feather");
  plan.raymap.seams = raymap.at("placed").get<bool>() ? SeamPlacement::kPlaced : SeamPlacement::kFixed;
  plan.raymap.soft = raymap.at("soft").get<bool>();
  plan.raymap.fields = raymap.at("separate").get<bool>() ? FieldUse::kSeparate : FieldUse::kWeave;
  const Json& coding = json.at("coding");
  const auto codec = codec_named(coding.at("codec").get<std::string>());
  const auto term = [&](std::size_t k) {
    return static_cast<std::uint64_t>(whole(coding.at("rate").at(k), "coding.rate", 1, FrameRate::kMaxTerm));
  };
  const auto rate = FrameRate::make(term(0), term(1));
  if (!codec || !rate) throw std::out_of_range("coding");
  plan.coding = {*codec,
                 plan.raymap.width,
                 plan.raymap.height,
                 in_8_bits(plan.raymap.format),
                 *rate,
                 static_cast<int>(whole(coding.at("quality"), "coding.quality", -1, 51)),
                 coding.at("preset").get<std::string>(),
                 coding.at("transfer").get<std::string>()};
  plan.container = static_cast<Container>(whole(json.at("container"), "container", 0, 2));
  plan.frames = static_cast<std::uint64_t>(whole(json.at("frames"), "frames", 1, FilmPlan::kMaxFrames));
  if (!take.is_null()) plan.take = take_of(take, plan.frames);
  const Json& heads = json.at("heads");
  if (!heads.is_array() || heads.size() != plan.calibration.heads.size()) throw std::out_of_range("heads");
  for (std::size_t h = 0; h < heads.size(); ++h) {
    plan.heads.push_back(head_of(heads[h], plan.calibration.heads[h], plan.frames));
  }
  plan.times_residual_s = real(json.at("times_residual"), "times_residual");
  if (const Json& sound = json.at("sound"); !sound.is_null()) {
    plan.sound = PlannedSound{sound.at("file").get<std::string>(), sound.at("codec").get<std::string>(),
                              real(sound.at("from"), "sound.from"), real(sound.at("ppm"), "sound.ppm")};
  }
  plan.light = light_of(json.at("light"), plan);
  plan.seams = seams_of(json.at("seams"), plan);
  return plan;
}

}  // namespace

std::string to_text(const FilmPlan& plan) {
  const RaymapConfig& raymap = plan.raymap;
  Json json{{"file", kFormat}, {"request", plan.request}};
  json["calibration"] = plan.take ? Json(nullptr) : Json::parse(nodal::to_json(plan.calibration));
  json["raymap"] = {{"layout", raymap.layout},
                    {"width", raymap.width},
                    {"height", raymap.height},
                    {"format", pixel_format_name(raymap.format)},
                    {"transition", static_cast<int>(raymap.transition)},
                    {"seam_width", raymap.seam_width_deg},
                    {"feather", raymap.feather},
                    {"placed", raymap.seams == SeamPlacement::kPlaced},
                    {"soft", raymap.soft},
                    {"separate", raymap.fields == FieldUse::kSeparate}};
  json["coding"] = {{"codec", name_of(plan.coding.codec)},
                    {"rate", {plan.coding.rate.numerator, plan.coding.rate.denominator}},
                    {"quality", plan.coding.quality},
                    {"preset", plan.coding.preset},
                    {"transfer", plan.coding.transfer}};
  json["container"] = static_cast<int>(plan.container);
  json["frames"] = plan.frames;
  json["heads"] = Json::array();
  for (const PlannedHead& head : plan.heads) json["heads"].push_back(to_json(head));
  json["take"] = nullptr;
  if (plan.take) {
    json["take"] = {{"folder", plan.take->folder},
                    {"heads", plan.take->heads},
                    {"farthest", plan.take->farthest_s},
                    {"raymaps", runs_of(steps_of(plan.take->raymaps))}};
  }
  json["times_residual"] = plan.times_residual_s;
  json["sound"] = nullptr;
  if (plan.sound) {
    json["sound"] = {{"file", plan.sound->path},
                     {"codec", plan.sound->codec},
                     {"from", plan.sound->from_s},
                     {"ppm", plan.sound->ppm}};
  }
  json["light"] = nullptr;
  if (!plan.light.frames.empty()) json["light"] = {{"frames", plan.light.frames}, {"stops", plan.light.stops}};
  json["seams"] = Json::array();
  for (const PlannedSeams& seams : plan.seams) {
    json["seams"].push_back({{"segment", seams.segment}, {"labels", runs_of(seams.labels)}});
  }
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

Result<FilmPlan> plan_of(const std::string& text) {
  try {
    const Json json = parse(text);
    if (!json.is_object() || !json.contains("file")) return fail(Errc::kBadFormat, "it is no plan of a film");
    if (json["file"] != kFormat) {
      return fail(Errc::kFutureVersion,
                  "it is the plan of another version of nodal; remove the folder that it is in, and "
                  "make the film anew");
    }
    FilmPlan plan = read(json);
    const auto* const bytes = reinterpret_cast<const std::uint8_t*>(text.data());
    plan.id = to_hex(sha256({bytes, text.size()})).substr(0, 12);
    return plan;
  } catch (const std::exception& error) {  // the field; of nlohmann's errors too
    return fail(Errc::kBadValue,
                fmt::format("the plan is damaged ({}); remove the folder that it is in", error.what()));
  }
}

}  // namespace nodal::film
