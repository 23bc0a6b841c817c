#include "host_tool/offload/take_json.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <ctime>

#include "protocol/take/file_names.h"

namespace nodal::host {
namespace {

/// As OSC's listFiles writes it; null if the rig's clock was not set.
Json osc_date(std::int64_t ns) {
  if (ns <= 0) return {};
  return fmt::format("{:%Y:%m:%d %H:%M:%S}+00:00", fmt::gmtime(static_cast<std::time_t>(ns / 1'000'000'000)));
}

}  // namespace

Json to_json(const wire::TakeEntry& take) {
  Json json{{"take", take.number()},
            {"name", take::take_folder(take.number())},
            {"date_time_zone", osc_date(take.started_utc_ns())},
            {"width", take.width()},
            {"height", take.height()},
            {"state", take.state()},
            {"started_utc_ns", take.started_utc_ns()},
            {"sets", take.sets()},
            {"lost_sets", take.lost_sets()},
            {"lost_by_errors", take.lost_by_errors()},
            {"not_captured", take.not_captured()},
            {"gaps", take.gaps()},
            {"longest_gap_ns", take.longest_gap_ns()},
            {"missing_pictures", take.missing_pictures()},
            {"rate", {take.rate_numerator(), take.rate_denominator()}},
            {"rates", take.rates()},
            {"deleted_sets", take.deleted_sets()},
            {"bytes", take.bytes()},
            {"length_ns", take.length_ns()},
            {"protected", take.is_protected()},
            {"ended", take.ended()}};
  if (!take.problem().empty()) json["problem"] = take.problem();
  return json;
}

}  // namespace nodal::host
