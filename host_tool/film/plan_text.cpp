// The plan as a JSON document, and back.
#include <fmt/format.h>

#include <algorithm>

#include "host_tool/film/film_plan.h"
#include "protocol/base/sha256.h"
#include "protocol/base/try.h"
#include "stitch/sets/blend_plan.h"

namespace nodal::film {
namespace {

constexpr const char* kFormat = "nodal film plan 1";
constexpr std::size_t kMapPixels = std::size_t{sets::kSeamMapWidth} * sets::kSeamMapWidth / 2;

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

std::vector<std::int64_t> values_of(const Json& runs, std::uint64_t count) {
  std::vector<std::int64_t> values;
  for (std::size_t at = 0; at + 1 < runs.size(); at += 2) {
    const auto repeated = runs[at + 1].get<std::uint64_t>();
    if (repeated > count - values.size()) throw std::out_of_range("runs");
    values.insert(values.end(), repeated, runs[at].get<std::int64_t>());
  }
  if (values.size() != count) throw std::out_of_range("runs");
  return values;
}

Json to_json(const PlannedHead& head) {
  std::vector<std::int64_t> steps;
  std::int64_t before = 0;
  for (const std::int64_t time : head.times) {
    steps.push_back(time - before);
    before = time;
  }
  const FilmFile& film = head.film;
  return Json{{"name", head.name},
              {"film", film.path},
              {"width", film.width},
              {"height", film.height},
              {"format", pixel_format_name(film.format)},
              {"decoded_format", film.decoded_format},
              {"video_range", film.coding.video_range},
              {"bt709", film.coding.bt709},
              {"file_starts", film.file_starts_s},
              {"time_base", {film.time_base.num, film.time_base.den}},
              {"first", film.times.front()},
              {"farthest", head.farthest_s},
              {"steps", runs_of(steps)}};
}

PixelFormat format_of(const Json& name) {
  const auto format = pixel_format_named(name.get<std::string>());
  if (!format) throw std::out_of_range("format");
  return *format;
}

PlannedHead head_of(const Json& json, std::uint64_t frames) {
  PlannedHead head;
  head.name = json.at("name").get<std::string>();
  head.farthest_s = json.at("farthest").get<double>();
  FilmFile& film = head.film;
  film.path = json.at("film").get<std::string>();
  film.width = json.at("width").get<int>();
  film.height = json.at("height").get<int>();
  film.format = format_of(json.at("format"));
  film.decoded_format = json.at("decoded_format").get<std::string>();
  film.coding = {json.at("video_range").get<bool>(), json.at("bt709").get<bool>()};
  film.file_starts_s = json.at("file_starts").get<double>();
  film.time_base = {json.at("time_base").at(0).get<std::int64_t>(), json.at("time_base").at(1).get<std::int64_t>()};
  film.times = {json.at("first").get<std::int64_t>()};
  if (film.time_base.num <= 0 || film.time_base.den <= 0 || film.width <= 0 || film.height <= 0) {
    throw std::out_of_range("film");
  }
  head.times = values_of(json.at("steps"), frames);
  std::int64_t before = 0;
  for (std::int64_t& time : head.times) before = time += before;
  return head;
}

FilmPlan read(const Json& json) {
  FilmPlan plan;
  plan.request = json.at("request");
  auto calibration = parse_calibration(json.at("calibration").dump());
  if (!calibration) throw std::out_of_range(calibration.error().message);
  plan.calibration = std::move(*calibration);
  const Json& raymap = json.at("raymap");
  plan.raymap.layout = raymap.at("layout").get<std::string>();
  plan.raymap.width = raymap.at("width").get<int>();
  plan.raymap.height = raymap.at("height").get<int>();
  plan.raymap.format = format_of(raymap.at("format"));
  plan.raymap.transition = static_cast<Transition>(raymap.at("transition").get<int>() % 3);
  plan.raymap.seam_width_deg = raymap.at("seam_width").get<double>();
  plan.raymap.feather = raymap.at("feather").get<double>();
  plan.raymap.seams = raymap.at("placed").get<bool>() ? SeamPlacement::kPlaced : SeamPlacement::kFixed;
  const Json& coding = json.at("coding");
  const auto codec = codec_named(coding.at("codec").get<std::string>());
  const auto rate =
      FrameRate::make(coding.at("rate").at(0).get<std::uint64_t>(), coding.at("rate").at(1).get<std::uint64_t>());
  if (!codec || !rate) throw std::out_of_range("coding");
  plan.coding = {*codec,
                 plan.raymap.width,
                 plan.raymap.height,
                 plan.raymap.format,
                 *rate,
                 coding.at("quality").get<int>(),
                 coding.at("preset").get<std::string>(),
                 coding.at("transfer").get<std::string>()};
  plan.container = static_cast<Container>(json.at("container").get<int>() % 3);
  plan.frames = json.at("frames").get<std::uint64_t>();
  for (const Json& head : json.at("heads")) plan.heads.push_back(head_of(head, plan.frames));
  if (plan.frames == 0 || plan.heads.size() != plan.calibration.heads.size()) throw std::out_of_range("heads");
  if (const Json& sound = json.at("sound"); !sound.is_null()) {
    plan.sound = PlannedSound{sound.at("file").get<std::string>(), sound.at("codec").get<std::string>(),
                              sound.at("from").get<double>(), sound.at("ppm").get<double>()};
  }
  for (const Json& seams : json.at("seams")) {
    PlannedSeams placed{seams.at("segment").get<std::uint64_t>(), {}};
    for (const std::int64_t label : values_of(seams.at("labels"), kMapPixels)) {
      placed.labels.push_back(static_cast<std::uint8_t>(label));
    }
    plan.seams.push_back(std::move(placed));
  }
  return plan;
}

}  // namespace

std::string to_text(const FilmPlan& plan) {
  const RaymapConfig& raymap = plan.raymap;
  Json json{{"file", kFormat}, {"request", plan.request}};
  json["calibration"] = Json::parse(nodal::to_json(plan.calibration));
  json["raymap"] = {{"layout", raymap.layout},
                    {"width", raymap.width},
                    {"height", raymap.height},
                    {"format", pixel_format_name(raymap.format)},
                    {"transition", static_cast<int>(raymap.transition)},
                    {"seam_width", raymap.seam_width_deg},
                    {"feather", raymap.feather},
                    {"placed", raymap.seams == SeamPlacement::kPlaced}};
  json["coding"] = {{"codec", name_of(plan.coding.codec)},
                    {"rate", {plan.coding.rate.numerator, plan.coding.rate.denominator}},
                    {"quality", plan.coding.quality},
                    {"preset", plan.coding.preset},
                    {"transfer", plan.coding.transfer}};
  json["container"] = static_cast<int>(plan.container);
  json["frames"] = plan.frames;
  json["heads"] = Json::array();
  for (const PlannedHead& head : plan.heads) json["heads"].push_back(to_json(head));
  json["sound"] = nullptr;
  if (plan.sound) {
    json["sound"] = {{"file", plan.sound->path},
                     {"codec", plan.sound->codec},
                     {"from", plan.sound->from_s},
                     {"ppm", plan.sound->ppm}};
  }
  json["seams"] = Json::array();
  for (const PlannedSeams& seams : plan.seams) {
    json["seams"].push_back({{"segment", seams.segment}, {"labels", runs_of(seams.labels)}});
  }
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

Result<FilmPlan> plan_of(const std::string& text) {
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_object() || !json.contains("file")) return fail(Errc::kBadFormat, "it is no plan of a film");
  if (json["file"] != kFormat) {
    return fail(Errc::kFutureVersion,
                "it is the plan of another version of nodal; remove the folder that it is in, and "
                "make the film anew");
  }
  try {
    FilmPlan plan = read(json);
    const auto* const bytes = reinterpret_cast<const std::uint8_t*>(text.data());
    plan.id = to_hex(sha256({bytes, text.size()})).substr(0, 12);
    return plan;
  } catch (const std::exception& error) {  // nlohmann's, with the field
    return fail(Errc::kBadValue,
                fmt::format("the plan is damaged ({}); remove the folder that it is in", error.what()));
  }
}

}  // namespace nodal::film
