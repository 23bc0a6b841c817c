// What must compile, and one misuse at a time that must not: MISUSE picks it.
#include "protocol/base/units.h"

using nodal::Duration;
using nodal::Exposure;
using nodal::FrameRate;
using nodal::Gain;
using nodal::Instant;

void takes_exposure(Exposure);
void takes_duration(Duration);

void use() {
  const Instant now = Instant::from_ns(5);
  const Duration wait = Duration::milliseconds(3);
  takes_duration(now + wait - now);
  takes_exposure(Exposure::of(wait));
  takes_duration(FrameRate{}.period() * 2);
#if MISUSE == 1
  (void)(now + now);  // two moments have no sum
#elif MISUSE == 2
  takes_exposure(wait);  // a duration is no exposure without Exposure::of
#elif MISUSE == 3
  takes_duration(3'000'000);  // a bare number has no unit
#elif MISUSE == 4
  (void)(Gain::millidecibels(1) < wait);  // decibels and nanoseconds do not compare
#elif MISUSE == 5
  const std::int64_t raw = wait;  // the raw value is reached only by a name that spells its unit
  (void)raw;
#elif MISUSE == 6
  takes_duration(now);  // a moment is not a length of time
#elif MISUSE == 7
  takes_exposure(Gain::millidecibels(6020));
#elif MISUSE == 8
  (void)(wait * wait);  // nanoseconds squared are no unit here
#endif
}
