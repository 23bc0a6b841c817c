#include "firmware/operate/settings_writer.h"

#include <utility>

namespace nodal::firmware {

bool SettingsWriter::due(Instant now) const {
  if (!dirty_ || writing_) return false;
  return !ever_ || now - begun_ >= (failed_ ? kRetryEvery : kWriteEvery);
}

void SettingsWriter::begun(Instant now) {
  dirty_ = false;
  writing_ = true;
  ever_ = true;
  begun_ = now;
}

bool SettingsWriter::ended(const Status& stored) {
  writing_ = false;
  failed_ = !stored;
  dirty_ |= failed_;
  std::string problem;
  if (failed_) problem = "settings will not survive a restart: " + stored.error().message;
  if (problem == problem_) return false;
  problem_ = std::move(problem);
  return true;
}

}  // namespace nodal::firmware
