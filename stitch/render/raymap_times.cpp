#include "stitch/render/raymap_times.h"

#include <algorithm>

#include "protocol/base/try.h"
#include "protocol/take/tally.h"

namespace nodal::render {

Duration second_field(const take::wire::Begin& begin, FrameRate sets) {
  constexpr std::uint64_t kLongest = 1'000'000'000'000;  // ns
  const std::uint64_t recorded = begin.second_field_ns();
  if (recorded != 0) return Duration::nanoseconds(static_cast<std::int64_t>(std::min(recorded, kLongest)));
  return sets.period() / 2;
}

Result<RaymapTimes> raymap_times(const media::TakeFolder& folder, int raymaps_a_set) {
  RaymapTimes times{{}, folder.about().rate};
  media::TakeSets sets(folder);
  media::TakeSet set;
  for (;;) {
    NODAL_TRY_ASSIGN(const bool more, sets.next(set));
    if (!more) break;
    const take::wire::Begin& begin = sets.segment().evidence().begin;
    if (times.at.empty()) times.sets = take::rate_of(begin, folder.about().rate);
    times.at.push_back(set.mid_exposure);
    if (raymaps_a_set == 2) times.at.push_back(set.mid_exposure + second_field(begin, folder.about().rate));
  }
  if (times.at.empty()) return fail(Errc::kNotFound, folder.shown("") + ": the take has no sets");
  return times;
}

}  // namespace nodal::render
