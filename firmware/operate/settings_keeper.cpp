#include "firmware/operate/settings_keeper.h"

#include <cstdint>
#include <span>
#include <utility>

#include "firmware/frame/drain.h"

namespace nodal::firmware {

void SettingsKeeper::read(News& news) {
  if (restoring_) return;
  const SettingsReport& stored = store_.snapshot().read();
  if (!stored.file) return;
  restoring_.emplace();
  if (!stored.problem.empty()) {
    news.say(NewsKind::kRig, stored.problem);
    writer_.unreadable(stored.problem);
  }
  if (stored.file->empty()) return;
  auto settings = Settings::decode(
      std::span(reinterpret_cast<const std::uint8_t*>(stored.file->data()), stored.file->size()), rig_);
  if (!settings) {
    news.say(NewsKind::kRig, settings.error().message);
    // A changed rig.toml is intended and no problem; an unreadable file is one.
    if (settings.error().code != Errc::kWrongState) writer_.unreadable(settings.error().message);
    return;
  }
  settings_ = std::move(*settings);
  for (CaptureCommand& change : settings_.commands()) restoring_->push_back(std::move(change));
  news.say(NewsKind::kRig, "restoring the stored settings");
}

const CaptureCommand* SettingsKeeper::next_to_restore() const {
  return restoring_ && !restoring_->empty() ? &restoring_->front() : nullptr;
}

void SettingsKeeper::remember(const CaptureCommand& change) {
  settings_.remember(change);
  writer_.changed();
}

void SettingsKeeper::take_answers(News& news) {
  drain(store_.answers(), [&](const Status& stored) {
    if (!writer_.ended(stored)) return;
    news.say(NewsKind::kRig, stored ? "settings are stored again" : writer_.problem());
  });
}

void SettingsKeeper::write(Instant now) {
  if (!writer_.due(now)) return;
  if (store_.writes().push(settings_.encode(rig_))) writer_.begun(now);
}

}  // namespace nodal::firmware
