#include "firmware/operate/take_watch.h"

#include <algorithm>

namespace nodal::firmware {

bool TakeWatch::step(const Reports& reports, News& news, Instant now) {
  if (!reports.takes) return false;
  const TakeReport& takes = *reports.takes;
  if (takes.problem != problem_) {
    problem_ = takes.problem;
    if (!problem_.empty()) news.say(NewsKind::kRig, problem_);
  }
  if (takes.no_disk != no_disk_) {
    no_disk_ = takes.no_disk;
    news.say(NewsKind::kRig,
             no_disk_.empty() ? "the disk of the takes is there" : "the disk of the takes: " + no_disk_);
  }
  tell_calibration(reports);
  return at_start_ && wants_take(reports, now);
}

/// A take is to be started when the rig has a calibration and frames, and another one after a take that ended for a
/// reason that has passed: a new disk, room. A take that somebody stopped stays stopped.
bool TakeWatch::wants_take(const Reports& reports, Instant now) {
  const TakeReport& takes = *reports.takes;
  if (takes.recording) {
    start_ = {true, takes.disks, now, kFirstTakeWait};
    return false;
  }
  if (std::exchange(start_.disks, takes.disks) != takes.disks)
    start_ = {start_.begun, takes.disks, now, kFirstTakeWait};
  const bool wanted = (!start_.begun || takes.interrupted) && takes.has_room;
  const bool can = takes.ready && reports.keeper->ready && reports.capture->full_sets > 0;
  if (!wanted || now < start_.next || !can) return false;
  start_.next = now + start_.wait;
  start_.wait = std::min(start_.wait * 2, kLastTakeWait);
  return true;
}

/// A take has every calibration that its raymaps were made with.
void TakeWatch::tell_calibration(const Reports& reports) {
  const KeeperReport& keeper = *reports.keeper;
  if (keeper.in_force && keeper.document && (documents_.empty() || documents_.back().first != *keeper.in_force)) {
    documents_.emplace_back(*keeper.in_force, keeper.document);
    if (documents_.size() > kDocumentsKept) documents_.pop_front();
  }
  if (!reports.takes->recording) return;
  const Adoption& adopted = adoption_.read();
  if (adopted.calibration == told_calibration_) return;
  const auto known = std::ranges::find(documents_, adopted.calibration, &std::pair<Sha256, Document>::first);
  if (known == documents_.end()) return;
  if (calibrations_->push({adopted.first_set, adopted.calibration, *known->second}))
    told_calibration_ = adopted.calibration;
}

}  // namespace nodal::firmware
