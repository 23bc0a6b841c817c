#include "firmware/operate/panel.h"

namespace nodal::firmware {
namespace {

constexpr Duration kBeat = Duration::milliseconds(125);

/// A repeated pattern; each character is on (`-`) or off (`_`) for one beat.
struct Pattern {
  std::string_view state;
  std::string_view beats;
};
constexpr std::array kPatterns = {
    Pattern{"starting", "----____"},     Pattern{"no-calibration", "-_-_____________"},
    Pattern{"idle", "-_______________"}, Pattern{"running", "-"},
    Pattern{"degraded", "-_"},
};
constexpr std::string_view kMarkBeats = "_-";

bool lit(std::string_view beats, Duration into) {
  return beats[static_cast<std::size_t>(into.ns() / kBeat.ns()) % beats.size()] == '-';
}

}  // namespace

bool Panel::status_lamp(std::string_view state, Duration into) {
  for (const Pattern& pattern : kPatterns) {
    if (pattern.state == state) return lit(pattern.beats, into);
  }
  return false;
}

std::optional<PanelAction> Panel::step(const PanelView& view, Instant now) {
  if (view.state != state_) {
    state_ = view.state;
    state_since_ = now;
  }
  if (view.sets != sets_) {
    sets_ = view.sets;
    newest_set_ = now;
  }
  const std::optional<PanelAction> action = read_button(view.rolling, now);
  if (action == PanelAction::kMark) marked_ = now;
  light(status_, status_lamp(state_, now - state_since_), now);
  light(tally_, tally_lamp(view, now), now);
  return action;
}

std::optional<PanelAction> Panel::read_button(bool rolling, Instant now) {
  if (!button_) return std::nullopt;
  for (int taken = 0; taken < kEdgesAStep; ++taken) {
    const auto edge = button_->take_edge();
    if (!edge) {
      lose("button", edge.error());
      button_ = nullptr;
      return std::nullopt;
    }
    if (!*edge) return settle(rolling, now);
    // The level before this edge may have lasted for kSettle, also when one call reads both of its edges.
    const std::optional<PanelAction> action = settle(rolling, (*edge)->at);
    level_ = (*edge)->high;
    level_since_ = (*edge)->at;
    if (action) return action;
  }
  return std::nullopt;  // a contact that bounces without a pause, or a pin without a level
}

std::optional<PanelAction> Panel::settle(bool rolling, Instant now) {
  if (level_ != pressed_ && now - level_since_ >= kSettle) {
    pressed_ = level_;
    if (pressed_) {
      pressed_since_ = level_since_;
      acted_ = !rolling;
      if (!rolling) return PanelAction::kStart;  // at once: both a short and a long press start
    } else if (!acted_) {
      acted_ = true;
      return level_since_ - pressed_since_ < kHold ? PanelAction::kMark : PanelAction::kStop;
    }
  }
  if (pressed_ && level_ && !acted_ && now - pressed_since_ >= kHold) {
    acted_ = true;
    return PanelAction::kStop;
  }
  return std::nullopt;
}

bool Panel::tally_lamp(const PanelView& view, Instant now) {
  if (!view.rolling || !newest_set_ || now - *newest_set_ > kSilent.at(view.period)) return false;
  if (marked_ && now - *marked_ < kMarkShown) return lit(kMarkBeats, now - *marked_);
  return true;
}

void Panel::light(Lamp& lamp, bool on, Instant now) {
  if (!lamp.pin) return;
  Status done = lamp.pin->step(now);
  if (done && (!lamp.set || on != lamp.on || now - *lamp.set >= kLease / 2)) {
    done = lamp.pin->set(on, now, kLease);
    lamp.on = on;
    lamp.set = now;
  }
  if (done) return;
  lose(lamp.name, done.error());
  lamp.pin = nullptr;
}

void Panel::lose(std::string_view name, const Error& why) {
  problems_.push_back("the " + std::string(name) + " failed: " + why.message);
}

std::optional<std::string> Panel::take_problem() {
  if (problems_.empty()) return std::nullopt;
  std::string first = std::move(problems_.front());
  problems_.erase(problems_.begin());
  return first;
}

}  // namespace nodal::firmware
