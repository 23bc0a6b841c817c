// The part of TakeKeeper that stores the flight record of a take.
#include <fmt/format.h>

#include <limits>

#include "firmware/flight/flight_recorder.h"
#include "firmware/record/take_keeper.h"
#include "firmware/record/take_writer.h"

namespace nodal::firmware {

void TakeKeeper::begin_flight() {
  if (!flight_ || flight_->begin()) return;
  report_.problem = fmt::format(
      "take {} has no flight record, which must begin with nodald's start: {}; start nodald again before a take",
      writing_->number(),
      flight_->overrun() ? "events were lost, because the disk was too slow" : "nodald runs for too long");
}

bool TakeKeeper::write_flight(Instant now, int most) {
  if (!flight_) return false;
  flight_->collect(now);
  if (!writing_) return false;
  for (int k = 0; k < most; ++k) {
    const auto record = flight_->next();
    if (record.empty()) return k > 0;
    if (!broken_) writing_->write_flight(record);
  }
  return true;
}

void TakeKeeper::end_flight(Instant now) {
  if (!flight_) return;
  flight_->collect(now);
  flight_->close_record();
  write_flight(now, std::numeric_limits<int>::max());
  const auto last = flight_->end();
  if (!broken_ && !last.empty()) writing_->write_flight(last);
}

}  // namespace nodal::firmware
