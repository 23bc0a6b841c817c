// Code that must compile, and one misuse at a time that must not: MISUSE selects it.
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
  (void)(now + now);  // two Instants cannot be added
#elif MISUSE == 2
  takes_exposure(wait);  // a Duration does not convert to an Exposure
#elif MISUSE == 3
  takes_duration(3'000'000);  // a bare number has no unit
#elif MISUSE == 4
  (void)(Gain::millidecibels(1) < wait);  // decibels and nanoseconds do not compare
#elif MISUSE == 5
  const std::int64_t raw = wait;  // the raw value needs a function that names the unit
  (void)raw;
#elif MISUSE == 6
  takes_duration(now);  // an Instant is not a Duration
#elif MISUSE == 7
  takes_exposure(Gain::millidecibels(6020));
#elif MISUSE == 8
  (void)(wait * wait);  // there is no unit for squared nanoseconds
#endif
}
