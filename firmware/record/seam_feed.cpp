#include "firmware/record/seam_feed.h"

#include <utility>

#include "firmware/record/take_writer.h"

namespace nodal::firmware {

SeamFeed::SeamFeed(SeamLog* log) : log_(log) {
  if (log_) log_->open();
}

bool SeamFeed::step(TakeWriter* writer) {
  if (!log_) return false;
  bool busy = false;
  auto& changes = log_->changes();
  for (std::size_t taken = 0; taken < changes.capacity() && (!writer || writer->takes_seams()); ++taken) {
    auto change = changes.pop();
    if (!change) break;
    newest_ = std::move(*change);
    if (writer) writer->use_seams(*newest_);
    busy = true;
  }
  return busy;
}

void SeamFeed::begin(TakeWriter& writer) const {
  if (newest_) writer.use_seams(*newest_);
}

bool SeamFeed::is_behind(const TakeRow& row, Instant now) {
  if (!log_ || row.sets.empty() || closing_) return false;
  const std::uint64_t begun = log_->sets_begun();
  if (std::exchange(begun_, begun) != begun) begun_at_ = now;
  return begun <= row.sets.back().number && now - begun_at_ < kBlendWithin;
}

}  // namespace nodal::firmware
