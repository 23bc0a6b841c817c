#include "flight_player.h"

#include <fmt/format.h>

#include <utility>
#include <variant>
#include <vector>

#include "flight_text.h"

namespace nodal::flight {

using namespace firmware;

namespace {

/// As the record stores them, so all that it states is compared.
std::string stored(const CaptureEvent& event) {
  take::flight::Event message;
  FlightEncoder().encode(event, message);
  return message.SerializeAsString();
}

}  // namespace

std::string Difference::text() const {
  return fmt::format("event {}, {:.6f} s on nodald's clock, {}\n  recorded: {}\n  now:      {}", event,
                     static_cast<double>(at.ns()) / 1e9, place, recorded, now);
}

/// A head that answers what it answered then.
class FlightPlayer::Head final : public hal::HeadPort {
 public:
  Head(FlightPlayer& player, const HeadOpened& opened) : player_(player), opened_(opened) {}
  const hal::HeadIdentity& identity() const override { return opened_.identity; }
  const hal::HeadFormat& format() const override { return opened_.format; }
  const hal::HeadLimits& limits() const override { return opened_.limits; }
  Status start(hal::TriggerMode trigger) override { return called(Call::kStart, static_cast<std::int64_t>(trigger)); }
  void stop() override { (void)called(Call::kStop, 0); }
  Status set_exposure(Exposure exposure) override { return called(Call::kExposure, exposure.duration().ns()); }
  Status set_gain(Gain gain) override { return called(Call::kGain, gain.mdb()); }
  Status set_white_balance(WhiteBalance balance) override {
    return called(Call::kWhiteBalance, std::int64_t{balance.red_q12} << 16 | balance.blue_q12);
  }
  Status set_gamma(hal::Gamma gamma) override { return called(Call::kGamma, gamma.thousandths()); }
  Status nudge(Duration by) override { return called(Call::kNudge, by.ns()); }
  Result<std::optional<hal::FrameView>> take_frame() override {
    const auto mine = [this](const auto& event) { return event.head == opened_.head; };
    if (const auto frame = player_.take_if<HeadDelivered>(mine)) return frame->frame;
    if (const auto failed = player_.take_if<HeadFailed>(mine)) return fail(failed->error);
    return std::optional<hal::FrameView>();
  }
  void add_wake_ups(hal::WakeUps&) const override {}
  void release(hal::BufferSlot) override {}

 private:
  using Call = HeadCalled::Call;
  /// Returns what the head returned then.
  Status called(Call call, std::int64_t value) {
    HeadCalled now{opened_.head, call, value, {}};
    if (!player_.step_.empty()) {
      const auto* then = std::get_if<HeadCalled>(&player_.step_.front());
      if (then && then->head == now.head && then->call == call) now.status = then->status;
    }
    player_.compare(now);
    return now.status;
  }
  FlightPlayer& player_;
  const HeadOpened opened_;
};

class FlightPlayer::Heads final : public hal::HeadEnumerator {
 public:
  explicit Heads(FlightPlayer& player) : player_(player) {}
  Result<std::unique_ptr<hal::HeadPort>> open(const std::string& path) override {
    const auto& heads = player_.config_.heads;
    const auto opened = player_.take_if<HeadOpened>(
        [&](const HeadOpened& event) { return event.head < heads.size() && heads[event.head].port.text() == path; });
    if (!opened) {
      player_.differs(path, "", "is opened");
      return fail(Errc::kNoSuchDevice, path);
    }
    if (!opened->status) return fail(opened->status.error());
    return std::make_unique<Head>(player_, *opened);
  }
  std::vector<hal::HeadIdentity> list() override { return {}; }

 private:
  FlightPlayer& player_;
};

class FlightPlayer::Trigger final : public hal::TriggerPort {
 public:
  explicit Trigger(FlightPlayer& player) : player_(player) {}
  Status start(const hal::TriggerSettings& settings) override {
    TriggerStarted now{settings, {}};
    if (!player_.step_.empty()) {
      if (const auto* then = std::get_if<TriggerStarted>(&player_.step_.front())) now.status = then->status;
    }
    player_.compare(now);
    return now.status;
  }
  void stop() override { player_.compare(TriggerStopped{}); }
  Result<std::optional<hal::TriggerEdge>> take_edge() override {
    if (const auto pulse = player_.take_if<PulseSeen>({})) return pulse->edge;
    if (const auto failed = player_.take_if<TriggerFailed>({})) return fail(failed->error);
    return std::optional<hal::TriggerEdge>();
  }
  void add_wake_ups(hal::WakeUps&) const override {}
  void make_safe() noexcept override {}

 private:
  FlightPlayer& player_;
};

FlightPlayer::FlightPlayer(const RigConfig& config, FlightReader& reader)
    : config_(config), reader_(reader), heads_(std::make_unique<Heads>(*this)), light_(1024) {
  if (reader.begin().trigger) trigger_ = std::make_unique<Trigger>(*this);
  capture_ = std::make_unique<Capture>(config_, *heads_, trigger_.get());
  capture_->log_to(*this);
  capture_->meter_from(light_);
  // One reader that may hold as many sets as all readers of the rig.
  sets_ = &capture_->add_outlet({"player", OutletPolicy::kLossless, reader.begin().sets_held, 0});
}

FlightPlayer::~FlightPlayer() {
  over_ = true;
  held_.clear();
  capture_.reset();  // it stops the heads, which look at the members behind it
}

template <class E>
std::optional<E> FlightPlayer::take_if(const std::function<bool(const E&)>& holds) {
  if (over_ || step_.empty()) return std::nullopt;
  const auto* next = std::get_if<E>(&step_.front());
  if (!next || (holds && !holds(*next))) return std::nullopt;
  E taken = std::move(*std::get_if<E>(&step_.front()));
  step_.pop_front();
  ++done_;
  return taken;
}

void FlightPlayer::differs(const std::string& place, const std::string& recorded, const std::string& now) {
  if (over_) return;
  over_ = true;
  std::string then = recorded;
  if (then.empty() && !step_.empty()) {
    const std::string where = place_of(step_.front(), config_);
    then = (where == place ? "" : where + " ") + text_of(step_.front());
  }
  difference_ = Difference{done_, now_, place, then.empty() ? "the step ends" : then, now};
}

void FlightPlayer::compare(const CaptureEvent& event) {
  if (over_) return;
  if (step_.empty() || stored(step_.front()) != stored(event))
    return differs(place_of(event, config_), "", text_of(event));
  step_.pop_front();
  ++done_;
}

void FlightPlayer::note(CaptureEvent&& event) { compare(event); }

void FlightPlayer::take_sets() {
  while (auto set = sets_->take()) {
    if (on_set && !over_) on_set(**set);
    const std::uint64_t number = (*set)->number;
    held_.emplace(number, std::move(*set));
  }
}

/// Releases the sets whose return the record states next.
void FlightPlayer::collecting(std::uint32_t collection) {
  if (over_) return;
  take_sets();
  for (const CaptureEvent& event : step_) {
    const auto* returned = std::get_if<SetReturned>(&event);
    if (!returned || returned->collection != collection) return;
    held_.erase(returned->number);
  }
}

void FlightPlayer::step() {
  const auto* begun = std::get_if<StepBegun>(&step_.front());
  NODAL_ASSERT(begun);
  now_ = begun->now;
  if (steps_++ == 0) from_ = now_;
  for (const CaptureEvent& event : step_) {
    bool present = true;
    if (const auto* command = std::get_if<CommandTaken>(&event)) {
      CaptureRequest copy = command->command;
      present = capture_->requests().push(std::move(copy));
    } else if (const auto* light = std::get_if<LightTaken>(&event)) {
      blend::SphereLight copy = light->light;
      present = light_.push(std::move(copy));
    }
    if (!present) return differs(place_of(event, config_), text_of(event), "more of these in one step than fit");
  }
  capture_->step(now_);
  while (capture_->answers().pop()) {}
  take_sets();
  if (!over_ && !step_.empty()) differs(place_of(step_.front(), config_), "", "the step ends");
}

Result<std::optional<Difference>> FlightPlayer::play() {
  while (!over_) {
    auto next = reader_.next_step();
    if (!next) return fail(next.error());
    if (next->empty()) break;
    step_ = std::move(*next);
    step();
  }
  over_ = true;
  return difference_;
}

}  // namespace nodal::flight
