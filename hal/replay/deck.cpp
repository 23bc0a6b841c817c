#include "hal/replay/deck.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <deque>
#include <map>
#include <set>

#include "hal/replay/reel.h"
#include "protocol/base/limits.h"
#include "protocol/base/try.h"

namespace nodal::hal::replay {

namespace {

constexpr std::string_view kPictures = "replay:";
constexpr std::string_view kTakes = "take:";

/// Limit of frames that are started and not yet taken; far more than a head has buffers.
constexpr std::size_t kStartsKept = 64;

struct Start {
  std::uint64_t number = 0;
  Instant at;
};

/// Pulses for heads in external mode. Pulses are stored; every head reads them at its own position.
class ReplayTrigger final : public TriggerPort {
 public:
  explicit ReplayTrigger(ClockPort& clock) : clock_(clock) {}

  Status start(const TriggerSettings& settings) override {
    if (safe_.load()) return fail(gone());
    if (!settings.rate.valid() || settings.pulse_width.ns() <= 0 || settings.pulse_width >= settings.rate.period()) {
      return fail(Errc::kBadValue, fmt::format("trigger 'replay': a rate of {}/{} with pulses of {} us cannot be made; "
                                               "allowed is {}, with pulses shorter than the period",
                                               settings.rate.numerator, settings.rate.denominator,
                                               settings.pulse_width.us(), kFrameRatesAllowed));
    }
    if (settings.follow) return fail(Errc::kUnsupported, "trigger 'replay': there is nobody to follow; drive it");
    stop();
    rate_ = settings.rate;
    started_ = clock_.now();
    next_ = 0;
    running_ = true;
    edges_.clear();
    return {};
  }
  void stop() override {
    step();
    running_ = false;
  }
  void make_safe() noexcept override { safe_.store(true); }
  Result<std::optional<TriggerEdge>> take_edge() override {
    if (safe_.load()) return fail(gone());
    step();
    if (edges_.empty()) return std::optional<TriggerEdge>{};
    const TriggerEdge edge = edges_.front();
    edges_.pop_front();
    return std::optional<TriggerEdge>{edge};
  }

  void add_wake_ups(WakeUps& to) const override {
    if (running()) to.at(started_ + rate_.start_of(next_));
  }

  void step() {
    if (!running_ || safe_.load()) return;
    const std::uint64_t due = rate_.first_after(clock_.now() - started_);
    if (due > next_ + kStartsKept) {  // after a long pause, only those that are kept
      total_ += due - kStartsKept - next_;
      next_ = due - kStartsKept;
    }
    for (; next_ < due; ++next_) {
      const Instant at = started_ + rate_.start_of(next_);
      edges_.push_back({next_, at});
      sent_.push_back({next_, at});
      ++total_;
      if (edges_.size() > kStartsKept) edges_.pop_front();
      if (sent_.size() > kStartsKept) sent_.pop_front();
    }
  }
  bool running() const { return running_ && !safe_.load(); }
  std::uint64_t total() const { return total_; }
  std::uint64_t oldest() const { return total_ - sent_.size(); }
  /// The i-th pulse since the deck was made, oldest() to total() - 1.
  const Start& sent(std::uint64_t i) const { return sent_[static_cast<std::size_t>(i - oldest())]; }

 private:
  static Error gone() { return {Errc::kDeviceGone, "trigger 'replay': its line is safe for good; the program ends"}; }

  ClockPort& clock_;
  FrameRate rate_;
  Instant started_;
  std::uint64_t next_ = 0;
  bool running_ = false;
  std::atomic<bool> safe_{false};  ///< permanently
  std::deque<TriggerEdge> edges_;
  std::deque<Start> sent_;
  std::uint64_t total_ = 0;
};

}  // namespace

struct Deck::State {
  class Head;
  class Enumerator;

  State(ClockPort& c, const DeckOptions& o);
  ~State();

  ClockPort& clock;
  const DeckOptions options;
  ReplayTrigger trigger;
  std::map<std::string, std::optional<PixelFormat>> known;
  std::map<std::string, Fields> fields;
  std::set<std::string> open;
  std::set<std::string> noted;

  Fields fields_of(const std::string& path) const {
    const auto named = fields.find(path);
    return named == fields.end() ? Fields::kProgressive : named->second;
  }

  std::unique_ptr<Enumerator> enumerator;
};

class Deck::State::Head final : public HeadPort {
 public:
  Head(State& deck, const std::string& path, std::unique_ptr<Reel> reel)
      : deck_(deck),
        identity_{path, "", "pictures"},
        reel_(std::move(reel)),
        format_{reel_->format(), reel_->width(), reel_->height(), deck.fields_of(path), deck.options.rate},
        settings_(reel_->shot(0).in_effect),
        buffers_(static_cast<std::size_t>(std::max(1, deck.options.buffers))) {
    limits_.exposure_min = limits_.exposure_max = settings_.exposure;
    limits_.gain_min = limits_.gain_max = settings_.gain;
    limits_.has_trigger_input = true;
    deck_.open.insert(path);
  }
  ~Head() override { deck_.open.erase(identity_.path); }

  const HeadIdentity& identity() const override { return identity_; }
  const HeadFormat& format() const override { return format_; }
  const HeadLimits& limits() const override { return limits_; }

  Status start(TriggerMode mode) override {
    if (streaming_) return fail(Errc::kWrongState, "head '" + identity_.path + "': is started already; stop it first");
    deck_.trigger.step();
    streaming_ = true;
    mode_ = mode;
    sequence_ = 0;
    next_pulse_ = deck_.trigger.total();
    next_free_ = first_after(deck_.clock.now());
    return {};
  }
  void stop() override {
    streaming_ = false;
    filled_.clear();
    for (Buffer& buffer : buffers_) buffer = {};
  }
  Status set_exposure(Exposure exposure) override { return fixed(exposure == settings_.exposure, "exposure"); }
  Status set_gain(Gain gain) override { return fixed(gain == settings_.gain, "gain"); }
  Status set_white_balance(WhiteBalance /*balance*/) override {
    return fail(Errc::kUnsupported, "head '" + identity_.path + "': pictures have no white balance to set");
  }
  Status set_gamma(Gamma gamma) override {
    if (gamma == settings_.gamma) return {};
    return fail(Errc::kUnsupported, "head '" + identity_.path + "': pictures have no gamma to set");
  }
  Status nudge(Duration) override {
    return fail(Errc::kUnsupported, "head '" + identity_.path + "': pictures cannot be moved in time");
  }
  Result<std::optional<FrameView>> take_frame() override;
  void add_wake_ups(WakeUps& to) const override {
    if (!streaming_) return;
    if (follows_pulses()) deck_.trigger.add_wake_ups(to);
    else to.at(Instant{} + deck_.options.rate.start_of(next_free_));
  }
  void release(BufferSlot slot) override {
    if (slot < buffers_.size() && buffers_[slot].lent) buffers_[slot] = {};
  }

 private:
  struct Buffer {
    bool filled = false;
    bool lent = false;
    std::uint32_t sequence = 0;
    Start start;
    std::shared_ptr<const DecodedImage> picture{};  ///< kept alive while lent
  };

  Status fixed(bool same, const std::string& what) const {
    if (same) return {};
    return fail(Errc::kBadValue, "head '" + identity_.path + "': the " + what +
                                     " of pictures is what it was when they were taken; leave it out");
  }
  bool follows_pulses() const {
    return mode_ == TriggerMode::kExternal || (mode_ == TriggerMode::kWired && deck_.trigger.running());
  }
  std::uint64_t first_after(Instant now) const { return deck_.options.rate.first_after(now - Instant{}); }
  void skip_to(std::uint64_t& next, std::uint64_t oldest);
  void step();
  void fill(const Start& start);
  std::shared_ptr<const DecodedImage> broken_picture();

  State& deck_;
  const HeadIdentity identity_;
  const std::unique_ptr<Reel> reel_;
  const HeadFormat format_;
  const HeadSettings settings_;
  HeadLimits limits_;
  bool streaming_ = false;
  TriggerMode mode_ = TriggerMode::kFreeRun;
  std::uint32_t sequence_ = 0;
  std::uint64_t next_pulse_ = 0;
  std::uint64_t next_free_ = 0;
  std::vector<Buffer> buffers_;
  std::deque<BufferSlot> filled_;
  std::shared_ptr<const DecodedImage> grey_;
};

void Deck::State::Head::step() {
  if (follows_pulses()) {
    deck_.trigger.step();
    next_free_ = first_after(deck_.clock.now());
    skip_to(next_pulse_, deck_.trigger.oldest());
    for (; next_pulse_ < deck_.trigger.total(); ++next_pulse_) fill(deck_.trigger.sent(next_pulse_));
    return;
  }
  const std::uint64_t due = first_after(deck_.clock.now());
  skip_to(next_free_, due - std::min<std::uint64_t>(due, kStartsKept));
  for (; next_free_ < due; ++next_free_) fill({next_free_, Instant{} + deck_.options.rate.start_of(next_free_)});
}

/// Frames too old for any buffer are only counted.
void Deck::State::Head::skip_to(std::uint64_t& next, std::uint64_t oldest) {
  if (next >= oldest) return;
  sequence_ += static_cast<std::uint32_t>(oldest - next);
  next = oldest;
}

void Deck::State::Head::fill(const Start& start) {
  const std::uint32_t sequence = sequence_++;
  for (std::size_t slot = 0; slot < buffers_.size(); ++slot) {
    Buffer& buffer = buffers_[slot];
    if (buffer.filled || buffer.lent) continue;
    buffer = {true, false, sequence, start, nullptr};
    filled_.push_back(static_cast<BufferSlot>(slot));
    return;
  }
}

Result<std::optional<FrameView>> Deck::State::Head::take_frame() {
  if (!streaming_) return fail(Errc::kWrongState, "head '" + identity_.path + "': take_frame() before start()");
  step();
  Shot shot;
  BufferSlot slot = 0;
  do {
    if (filled_.empty()) return std::optional<FrameView>{};
    slot = filled_.front();
    filled_.pop_front();
    shot = reel_->shot(static_cast<std::size_t>(buffers_[slot].start.number % reel_->size()));
    if (!shot.present) buffers_[slot] = {};
  } while (!shot.present);
  Buffer& buffer = buffers_[slot];
  buffer.filled = false;
  buffer.lent = true;
  buffer.picture = std::move(shot.picture);
  FrameView view;
  if (!buffer.picture) {
    buffer.picture = broken_picture();
    view.verdict = FrameVerdict::kCorrupt;
  }
  view.slot = slot;
  view.sequence = buffer.sequence;
  view.mid_exposure = view.received = buffer.start.at;
  view.in_effect = shot.in_effect;
  view.fields = format_.fields;
  view.image = buffer.picture->view();
  view.image.coding = reel_->coding();
  return std::optional<FrameView>{view};
}

std::shared_ptr<const DecodedImage> Deck::State::Head::broken_picture() {
  if (!grey_) {
    DecodedImage grey{format_.pixels, format_.width, format_.height, {}};
    grey.bytes.assign(packed_size(grey.format, grey.width, grey.height), 128);
    grey_ = std::make_shared<const DecodedImage>(std::move(grey));
  }
  return grey_;
}

class Deck::State::Enumerator final : public HeadEnumerator {
 public:
  explicit Enumerator(State& deck) : deck_(deck) {}

  Result<std::unique_ptr<HeadPort>> open(const std::string& path) override {
    if (deck_.open.count(path) != 0) return fail(Errc::kBusy, "head '" + path + "': is open already");
    auto reel = open_reel(path);
    if (!reel) return fail(reel.error().in("head '" + path + "'"));
    deck_.known.emplace(path, std::nullopt);
    const std::string left_out = (*reel)->left_out();
    if (!left_out.empty() && deck_.options.note && deck_.noted.insert(left_out).second) deck_.options.note(left_out);
    return std::make_unique<Head>(deck_, path, std::move(*reel));
  }

  std::vector<HeadIdentity> list() override {
    std::vector<HeadIdentity> connected;
    for (const auto& [path, format] : deck_.known) {
      if (present(path)) connected.push_back({path, "", "pictures"});
    }
    return connected;
  }

 private:
  /// The folder of a take, and the name of its head.
  struct OfTake {
    std::filesystem::path folder;
    std::string head;
  };
  std::optional<OfTake> of_take(const std::string& path) const {
    if (!path.starts_with(kTakes)) return std::nullopt;
    const std::filesystem::path both = path.substr(kTakes.size());
    return OfTake{deck_.options.base / both.parent_path(), both.filename().string()};
  }
  std::filesystem::path pictures(const std::string& path) const {
    return deck_.options.base / path.substr(kPictures.size());
  }
  bool present(const std::string& path) const {
    std::error_code error;
    if (const auto take = of_take(path)) return std::filesystem::is_directory(take->folder, error);
    return pictures_present(pictures(path));
  }
  Result<std::unique_ptr<Reel>> open_reel(const std::string& path) const {
    const auto asked = deck_.known.find(path);
    const auto as = asked == deck_.known.end() ? std::nullopt : asked->second;
    if (path.starts_with(kPictures)) {
      return open_pictures(pictures(path), as, deck_.options.keep_bytes, deck_.options.pictures);
    }
    const auto take = of_take(path);
    if (!take) return fail(Errc::kNoSuchDevice, "a replay head's path begins with 'replay:' or 'take:'");
    NODAL_TRY_ASSIGN(auto reel, deck_.options.takes(take->folder, take->head));
    NODAL_TRY(compare(*reel, as.value_or(reel->format()), deck_.fields_of(path)));
    return reel;
  }
  /// A take cannot be played as something else.
  Status compare(const Reel& reel, PixelFormat format, Fields fields) const {
    if (reel.format() != format) {
      return fail(Errc::kBadValue, "the take's pictures are " + std::string(pixel_format_name(reel.format())) +
                                       "; write format = \"" + std::string(pixel_format_name(reel.format())) + "\"");
    }
    const Fields has = reel.fields().value_or(fields);
    if (has != fields) {
      const std::string name(fields_name(has));
      return fail(Errc::kBadValue, "the take's frames are " + name + "; write fields = \"" + name + "\"");
    }
    const FrameRate rate = reel.rate().value_or(deck_.options.rate);
    if (rate == deck_.options.rate) return {};
    const std::string text = fmt::format("{}/{}", rate.numerator, rate.denominator);
    return fail(Errc::kBadValue, "the take has " + text + " sets a second; write rate = \"" + text + "\"");
  }

  State& deck_;
};

Deck::State::State(ClockPort& c, const DeckOptions& o)
    : clock(c), options(o), trigger(c), enumerator(std::make_unique<Enumerator>(*this)) {}
Deck::State::~State() {
  NODAL_ASSERT(open.empty());  // heads must be destroyed before their deck
}

Deck::Deck(ClockPort& clock, const DeckOptions& options) : state_(std::make_unique<State>(clock, options)) {}
Deck::~Deck() = default;

TriggerPort& Deck::trigger() { return state_->trigger; }
HeadEnumerator& Deck::enumerator() { return *state_->enumerator; }
void Deck::want_format(const std::string& path, PixelFormat format) { state_->known[path] = format; }
void Deck::want_fields(const std::string& path, Fields fields) { state_->fields[path] = fields; }

}  // namespace nodal::hal::replay
