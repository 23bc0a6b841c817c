#include "rates_ports.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <memory>

#include "exact_rate.h"
#include "hal/replay/deck.h"
#include "hal/sim/clock.h"
#include "hal/sim/rig.h"
#include "stitch/media/image_file.h"
#include "stitch/media/picture_folder.h"

namespace nodal::fuzz {
namespace {

constexpr int kPauses = 12;
constexpr std::int64_t kCentury = std::int64_t{100} * 365 * 86'400 * 1'000'000'000;

/// Advances the clock, mostly by up to a second, else by any time up to a century in total.
void pause(ByteReader& in, hal::sim::SimClock& clock) {
  const bool long_one = in.u8() % 4 == 0;
  const auto by = static_cast<std::int64_t>(telling(in, long_one ? 62 : 30));
  if (clock.now().ns() + by <= kCentury) clock.advance(Duration::nanoseconds(by));
}

hal::TriggerSettings drawn_settings(ByteReader& in) {
  hal::TriggerSettings settings;
  settings.rate = {telling32(in), telling32(in)};
  if (const auto reduced = FrameRate::make(settings.rate.numerator, settings.rate.denominator))
    settings.rate = *reduced;
  settings.pulse_width = Duration::microseconds(100);
  if (in.u8() % 8 == 0) settings.pulse_width = Duration::nanoseconds(static_cast<std::int64_t>(telling(in)));
  return settings;
}

/// Counts the pulses that reach a head; they must be in order.
class Sink final : public hal::sim::PulseSink {
 public:
  void on_pulse(std::uint64_t number, Instant) override {
    NODAL_ASSERT(number >= next_);  // those between were unseen, or lost on the line
    next_ = number + 1;
    ++seen;
  }
  void on_unseen(std::uint64_t pulses) override { unseen += pulses; }
  std::uint64_t seen = 0, unseen = 0;

 private:
  std::uint64_t next_ = 0;
};

/// Takes all edges: their numbers rise, their times follow the rate, and their count is within the trigger's limit.
std::optional<std::uint64_t> drain(hal::TriggerPort& port, FrameRate rate, Instant from, bool exact) {
  constexpr int kMaxEdges = 1024;
  std::optional<std::uint64_t> newest;
  for (int taken = 0;; ++taken) {
    NODAL_ASSERT(taken <= kMaxEdges);
    const auto edge = port.take_edge();
    NODAL_ASSERT(edge);
    if (!*edge) return newest;
    NODAL_ASSERT(!newest || (*edge)->number > *newest);
    newest = (*edge)->number;
    if (exact) NODAL_ASSERT(begins_at(rate, *newest, (*edge)->at - from));
  }
}

/// One grey picture in memory, under a name that a reel can open.
const std::string& picture_path() {
  static const std::string path = [] {
    constexpr std::array<std::uint8_t, 67> kGreyPixel = {
        0x89, 0x50, 0x4E, 0x47, 0x0D, 0x0A, 0x1A, 0x0A, 0x00, 0x00, 0x00, 0x0D, 0x49, 0x48, 0x44, 0x52, 0x00,
        0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x00, 0x00, 0x00, 0x00, 0x3A, 0x7E, 0x9B, 0x55, 0x00,
        0x00, 0x00, 0x0A, 0x49, 0x44, 0x41, 0x54, 0x78, 0xDA, 0x63, 0x68, 0x00, 0x00, 0x00, 0x82, 0x00, 0x81,
        0xDA, 0x45, 0x08, 0x3B, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4E, 0x44, 0xAE, 0x42, 0x60, 0x82};
    const int fd = ::memfd_create("picture", 0);
    NODAL_ASSERT(fd >= 0 &&
                 ::write(fd, kGreyPixel.data(), kGreyPixel.size()) == static_cast<ssize_t>(kGreyPixel.size()));
    return "/proc/self/fd/" + std::to_string(fd);
  }();
  return path;
}

Calibration one_head() {
  Calibration calibration;
  HeadCalibration head;
  head.name = "cam0";
  head.width = head.height = 16;
  head.center_x = head.center_y = 8;
  head.lens = RectilinearLens{{8}};
  head.R_head_rig = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  head.region = {0, 0, 16, 16, std::nullopt};
  head.vignetting = {8, 8, 8, {}};
  calibration.heads = {head};
  return calibration;
}

}  // namespace

void check_sim_trigger(ByteReader& in) {
  hal::sim::SimClock clock;
  hal::sim::TriggerOptions options;
  const unsigned how = in.u8();
  if (how & 1) options.drift_ppb = static_cast<std::int64_t>(in.u32() % 200'000'001) - 100'000'000;
  const hal::TriggerSettings settings = drawn_settings(in);
  if (how & 2) options.jitter = settings.rate.valid() ? settings.rate.period() / 4 : Duration();
  hal::sim::SimTrigger trigger(clock, options, how);
  Sink sink;
  trigger.connect(0, &sink);
  const bool started = trigger.start(settings).has_value();
  NODAL_ASSERT(!started || settings.rate.valid());
  if (!started) return;
  const Instant from = clock.now() + options.first_pulse;
  const bool exact = (how & 3) == 0;
  for (int i = 0; i < kPauses && in.left() > 0; ++i) {
    pause(in, clock);
    const std::uint64_t before = sink.seen;
    trigger.step(clock.now());
    NODAL_ASSERT(sink.seen - before <= 2 * hal::sim::SimTrigger::kEdgesKept + 1);
    NODAL_ASSERT(sink.seen + sink.unseen == trigger.pulses_sent());
    if (exact) NODAL_ASSERT(trigger.pulses_sent() == frames_begun(settings.rate, clock.now() - from));
    drain(trigger, settings.rate, from, exact);
  }
}

void check_sim_head(ByteReader& in) {
  const std::optional<FrameRate> rate = drawn_rate(in);
  if (!rate) return;
  hal::sim::SimRigOptions options;
  options.scene = hal::sim::constant_scene({0.5F, 0.5F, 0.5F});
  options.head.pixels = PixelFormat::kGrey8;
  options.head.rate = *rate;
  options.head.free_run_phase = Duration();
  const unsigned how = in.u8();
  if (how & 1) options.head.free_run_drift_ppm = static_cast<std::int32_t>(in.u32() % 200'001) - 100'000;
  hal::sim::SimRig world(one_head(), options);
  auto port = world.enumerator().open("sim:cam0");
  NODAL_ASSERT(port);
  const Instant from = world.clock().now();
  const Status started = (*port)->start(hal::TriggerMode::kFreeRun);
  NODAL_ASSERT(started);
  for (int i = 0; i < kPauses && in.left() > 0; ++i) {
    pause(in, world.clock());
    int frames = 0;
    for (auto frame = (*port)->take_frame(); frame && *frame; frame = (*port)->take_frame()) {
      ++frames;
      NODAL_ASSERT(frames <= options.head.buffers);
      (*port)->release((*frame)->slot);
    }
    const hal::sim::HeadCounts& c = world.head(0).counts();
    NODAL_ASSERT(c.exposed + c.duplicated == c.taken + c.without_buffer + c.by_fault + c.discarded + c.waiting);
    if ((how & 1) == 0) {
      NODAL_ASSERT(c.exposed + c.pulses_ignored == frames_begun(*rate, world.clock().now() - from));
    }
  }
}

void check_replay_trigger(ByteReader& in) {
  hal::sim::SimClock clock;
  hal::replay::Deck deck(clock, {});
  const hal::TriggerSettings settings = drawn_settings(in);
  const bool started = deck.trigger().start(settings).has_value();
  NODAL_ASSERT(!started || settings.rate.valid());
  if (!started) return;
  const Instant from = clock.now();
  std::uint64_t seen = 0;
  for (int i = 0; i < kPauses && in.left() > 0; ++i) {
    pause(in, clock);
    const auto newest = drain(deck.trigger(), settings.rate, from, true);
    const std::uint64_t begun = frames_begun(settings.rate, clock.now() - from);
    NODAL_ASSERT(newest ? *newest + 1 == begun : seen == begun);
    seen = begun;
  }
}

void check_replay_head(ByteReader& in) {
  const std::optional<FrameRate> rate = drawn_rate(in);
  if (!rate) return;
  hal::sim::SimClock clock;
  hal::replay::DeckOptions options;
  options.pictures = {media::read_image_header, media::read_image, media::jpegs_and_pngs_in};
  options.rate = *rate;
  hal::replay::Deck deck(clock, options);
  const bool pulsed = in.u8() % 2 == 1;
  auto port = deck.enumerator().open("replay:" + picture_path());
  NODAL_ASSERT(port);
  hal::TriggerSettings settings;
  settings.rate = *rate;
  settings.pulse_width = Duration::microseconds(100);
  const Status pulses = pulsed ? deck.trigger().start(settings) : Status();
  NODAL_ASSERT(pulses);
  const Status started = (*port)->start(pulsed ? hal::TriggerMode::kExternal : hal::TriggerMode::kFreeRun);
  NODAL_ASSERT(started);
  const Instant from = pulsed ? clock.now() : Instant();
  // When a head in external mode starts, pulse 0 has been sent; in free run, the grid's frames so far are in the past.
  const std::uint64_t before = frames_begun(*rate, clock.now() - from);
  for (int i = 0; i < kPauses && in.left() > 0; ++i) {
    pause(in, clock);
    int frames = 0;
    std::optional<std::uint32_t> newest;
    for (auto frame = (*port)->take_frame(); frame && *frame; frame = (*port)->take_frame()) {
      ++frames;
      NODAL_ASSERT(frames <= options.buffers);
      newest = (*frame)->sequence;
      (*port)->release((*frame)->slot);
    }
    const std::uint64_t begun = frames_begun(*rate, clock.now() - from) - before;
    // The oldest frames that found a buffer arrive; the device's counter counts all frames.
    NODAL_ASSERT(!newest || *newest < static_cast<std::uint32_t>(begun) || begun > UINT32_MAX);
  }
}

}  // namespace nodal::fuzz
