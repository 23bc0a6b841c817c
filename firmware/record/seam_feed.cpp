#include "firmware/record/seam_feed.h"

#include <utility>

#include "firmware/record/take_writer.h"

namespace nodal::firmware {

SeamFeed::SeamFeed(Blender* blender) : blender_(blender) {
  if (blender_) blender_->seams().log_changes();
}

bool SeamFeed::step(TakeWriter* writer) {
  if (!blender_) return false;
  bool busy = false;
  auto& changes = blender_->seams().changes();
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
  if (!blender_ || row.sets.empty() || closing_) return false;
  const std::uint64_t begun = blender_->sets_begun();
  if (std::exchange(begun_, begun) != begun) begun_at_ = now;
  return begun <= row.sets.back().number && now - begun_at_ < kBlendWithin;
}

}  // namespace nodal::firmware
