#include "host_tool/film/take_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "host_tool/film/film_time.h"
#include "protocol/base/raymap_rate.h"
#include "protocol/base/sha256.h"
#include "protocol/base/try.h"
#include "protocol/take/documents.h"
#include "stitch/render/raymap_times.h"

namespace nodal::film {

Json words_of(const TakeRequest& request, const media::TakeFolder& take, const Programs& programs) {
  const std::string manifest = take::manifest_json(take.manifest());
  const auto* const bytes = reinterpret_cast<const std::uint8_t*>(manifest.data());
  Json words{{"take", to_hex(sha256({bytes, manifest.size()}))},
             {"calibration", request.calibration},
             {"from", request.from.ns()},
             {"to", request.to.ns()}};
  add_words(words, request, programs);
  return words;
}

Result<FilmPlan> make_plan(const TakeRequest& request, const media::TakeFolder& take, const Programs& programs,
                           std::vector<std::string>& notes) {
  const int a_set = request.raymap.raymaps_a_set();
  NODAL_TRY_ASSIGN(const render::RaymapTimes times, render::raymap_times(take, a_set));
  const auto rate = raymap_rate(times.sets, a_set);
  if (!rate) return fail(Errc::kUnsupported, take.shown("") + ": its rate is too high for a film");
  FilmPlan plan;
  plan.request = words_of(request, take, programs);
  plan.raymap = request.raymap;
  plan.container = request.container;
  plan.coding = {request.codec.value_or(usual_codec(request.container, plan.raymap.width)),
                 plan.raymap.width,
                 plan.raymap.height,
                 in_8_bits(plan.raymap.format),
                 usual_rate(*rate),
                 request.quality,
                 request.preset,
                 ""};

  // As the frames of a head whose film has the take's times.
  FilmFile shown;
  shown.path = take.shown("");
  shown.time_base = {1, 1'000'000'000};
  std::int64_t before = 0;  // raymaps
  for (const Instant at : times.at) {
    const Duration since = at - times.at.front();
    const bool wanted = since >= request.from && since < request.to;
    if (wanted && (shown.times.empty() || at.ns() > shown.times.back())) shown.times.push_back(at.ns());
    if (shown.times.empty()) ++before;
  }
  if (shown.times.empty()) {
    return fail(Errc::kNotFound, shown.path + ": the take has no set between --from and --to");
  }
  const HeadTime own{};
  NODAL_TRY_ASSIGN(const FilmSpan span, chosen_span({shown}, {own}, request.preview, plan.coding.rate));
  NODAL_TRY(check(plan.coding, request.container, programs));
  const double period = 1.0 * plan.coding.rate.denominator / plan.coding.rate.numerator;
  PlannedTake planned{shown.path, take.about().heads, {}, 0};
  for (const std::size_t frame : nearest_frames(shown, own, span, period, &planned.farthest_s)) {
    planned.raymaps.push_back(before + static_cast<std::int64_t>(frame));
  }
  plan.frames = span.frames;
  const auto repeated = static_cast<std::uint64_t>(std::ranges::count_if(
      planned.raymaps,
      [last = std::int64_t{-1}](std::int64_t raymap) mutable { return std::exchange(last, raymap) == raymap; }));
  if (repeated > 0) {
    notes.push_back(
        fmt::format("{}: sets are missing in the take; {} of {} frames show the nearest raymap again, which is up to "
                    "{:.1f} ms away",
                    shown.path, repeated, plan.frames, 1000 * planned.farthest_s));
  }
  plan.take = std::move(planned);
  return plan;
}

}  // namespace nodal::film
