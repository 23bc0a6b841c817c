#include "protocol/take/documents.h"

#include <fmt/format.h>

#include <algorithm>

#include "protocol/base/try.h"
#include "protocol/take/json_fields.h"
#include "protocol/take/limits.h"

namespace nodal::take {

Result<Json> parse_document(const TextPieces& text, const std::string& file, std::size_t limit,
                            const JsonShape& shape) {
  auto json = parse_strict_json(text, {.bytes = limit, .depth = 8}, shape);
  if (!json) return fail(json.error().in(file));
  if (!json->is_object()) return fail(Errc::kBadFormat, file + ": not a JSON object");
  NODAL_TRY_ASSIGN(const auto version, JsonFields(*json, file).number("version", UINT32_MAX));
  if (version != static_cast<std::uint64_t>(kTakeVersion)) {
    return fail(Errc::kFutureVersion,
                fmt::format("{}: version {}; this program knows {}", file, version, kTakeVersion));
  }
  return json;
}

nlohmann::ordered_json rate_json(FrameRate rate) { return {rate.numerator, rate.denominator}; }

Result<FrameRate> rate_in(const Json& list, const JsonFields& fields) {
  if (!list.is_array() || list.size() != 2 || !list[0].is_number_unsigned() || !list[1].is_number_unsigned()) {
    return fields.wrong("rate", "not two numbers");
  }
  const auto rate = FrameRate::make(list[0].get<std::uint64_t>(), list[1].get<std::uint64_t>());
  if (!rate) return fields.wrong("rate", "not a frame rate");
  return *rate;
}

std::string take_json(const TakeDocument& take) {
  nlohmann::ordered_json json{{"take", take.number},
                              {"version", kTakeVersion},
                              {"rig", take.rig},
                              {"software", take.software},
                              {"started_utc_ns", take.started_utc_ns},
                              {"started_ns", take.started_ns},
                              {"rate", rate_json(take.rate)},
                              {"raymaps_a_set", take.raymaps_a_set},
                              {"mode", take.mode},
                              {"calibration", take.calibration_id},
                              {"layout", take.layout},
                              {"raymap", {take.raymap_width, take.raymap_height}},
                              {"heads", take.heads}};
  return json.dump(2) + "\n";
}

Result<TakeDocument> parse_take_json(std::string_view text, const std::string& file) {
  const JsonShape value = JsonShape::value(256);
  const JsonShape shape = JsonShape::object({{"version", value},
                                             {"take", value},
                                             {"rig", value},
                                             {"software", value},
                                             {"started_utc_ns", value},
                                             {"started_ns", value},
                                             {"raymaps_a_set", value},
                                             {"rate", JsonShape::list(2, value)},
                                             {"mode", value},
                                             {"calibration", value},
                                             {"layout", value},
                                             {"raymap", JsonShape::list(2, value)},
                                             {"heads", JsonShape::list(kMaxHeads, value)}});
  NODAL_TAKE(json, parse_document(one_piece(text), file, kMaxTakeJsonBytes, shape));
  const JsonFields fields(json, file);
  TakeDocument take;
  NODAL_TAKE(number, fields.number("take", kMaxTakeNumber));
  NODAL_TAKE(rig, fields.text("rig", kMaxTakeTextBytes));
  NODAL_TAKE(software, fields.text("software", kMaxTakeTextBytes));
  NODAL_TAKE(started, fields.number("started_utc_ns", static_cast<std::uint64_t>(kMaxUtcNs)));
  // A nodald of before did not write these two.
  NODAL_TAKE(started_ns, json.contains("started_ns")
                             ? fields.number("started_ns", static_cast<std::uint64_t>(kMaxTimeNs))
                             : Result<std::uint64_t>(0));
  NODAL_TAKE(a_set, json.contains("raymaps_a_set") ? fields.number("raymaps_a_set", 2) : Result<std::uint64_t>(1));
  NODAL_TAKE(rate, fields.list("rate", 2));
  NODAL_TAKE(mode, fields.text("mode", 32));
  NODAL_TAKE(calibration, fields.text("calibration", 64));
  NODAL_TAKE(layout, fields.text("layout", kMaxTakeTextBytes));
  NODAL_TAKE(raymap, fields.list("raymap", 2));
  NODAL_TAKE(heads, fields.list("heads", kMaxHeads));
  NODAL_TAKE(valid, rate_in(*rate, fields));
  constexpr std::uint64_t kMaxPixels = 1 << 16;
  for (const Json& side : *raymap) {
    if (raymap->size() != 2 || !side.is_number_unsigned() || side.get<std::uint64_t>() > kMaxPixels)
      return fields.wrong("raymap", "not a width and a height");
  }
  for (const Json& head : *heads) {
    if (!head.is_string() || head.get_ref<const std::string&>().size() > kMaxTakeTextBytes ||
        !is_printable(head.get_ref<const std::string&>())) {
      return fields.wrong("heads", "not a list of names");
    }
    take.heads.push_back(head.get<std::string>());
  }
  take.number = number;
  take.rig = rig;
  take.software = software;
  take.started_utc_ns = static_cast<std::int64_t>(started);
  take.started_ns = static_cast<std::int64_t>(started_ns);
  take.rate = valid;
  take.raymaps_a_set = std::max(1, static_cast<int>(a_set));
  take.mode = mode;
  take.calibration_id = calibration;
  take.layout = layout;
  if (raymap->size() == 2) {
    take.raymap_width = (*raymap)[0].get<int>();
    take.raymap_height = (*raymap)[1].get<int>();
  }
  return take;
}

std::optional<std::int64_t> TakeDocument::utc_offset_ns() const {
  if (started_utc_ns == 0 || started_ns == 0) return std::nullopt;
  return started_utc_ns - started_ns;
}

}  // namespace nodal::take
