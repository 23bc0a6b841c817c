#include "tests/sim/draw.h"

#include <algorithm>
#include <array>

namespace nodal::swarm {
namespace {

Duration up_to(hal::sim::Random& random, Duration most) {
  return Duration::nanoseconds(static_cast<std::int64_t>(random.below(static_cast<std::uint64_t>(most.ns()) + 1)));
}

/// Frames cost wall time: most rigs are slow, some run at common rates, including 29.97.
FrameRate draw_rate(hal::sim::Random& random) {
  constexpr std::array<FrameRate, 10> kRates = {
      FrameRate{5, 1},  FrameRate{6, 1},  FrameRate{15, 2}, FrameRate{8, 1},  FrameRate{10, 1},
      FrameRate{10, 1}, FrameRate{12, 1}, FrameRate{15, 1}, FrameRate{25, 1}, FrameRate{30000, 1001}};
  return kRates[random.below(kRates.size())];
}

/// Most heads can be shifted both ways, in steps of lines or packets; in some rigs heads can only be delayed, or one or
/// two cannot be shifted at all.
void draw_alignment(hal::sim::Random& random, Nature& nature) {
  nature.aligned = true;
  constexpr std::array<std::int64_t, 5> kSteps = {1, 8, 15, 30, 60};
  const Duration step = Duration::microseconds(kSteps[random.below(kSteps.size())]);
  const std::int64_t most = nature.rate.period().ns() / (4 + static_cast<std::int64_t>(random.below(13)));
  const Duration longest = step * (most / step.ns());
  const bool only_wait = random.chance(150'000);
  for (HeadNature& head : nature.head) {
    head.nudge = {step, only_wait && random.chance(700'000) ? Duration() : -longest, longest,
                  std::max(head.control_latency, 1)};
  }
  const std::uint64_t fixed = !only_wait && random.chance(250'000) ? 1 + random.below(2) : 0;
  for (std::uint64_t i = 0; i < fixed; ++i) nature.head[random.below(nature.head.size())].nudge = {};
  const auto unmoved = std::count_if(nature.head.begin(), nature.head.end(),
                                     [](const HeadNature& head) { return !head.nudge.possible(); });
  nature.can_align = unmoved < 2;
}

/// One rig of two has heads of one grey format, as these cost the least time. In the others each head delivers one of
/// the formats of which the raymap can be made.
void draw_formats(hal::sim::Random& random, Nature& nature) {
  if (random.chance(500'000)) return;
  constexpr std::array<PixelFormat, 4> kRaymaps = {PixelFormat::kI420, PixelFormat::kI420, PixelFormat::kRgb24,
                                                   PixelFormat::kGrey8};
  constexpr std::array<PixelFormat, 14> kHeads = {
      PixelFormat::kGrey8, PixelFormat::kI420,  PixelFormat::kNv12,   PixelFormat::kYuyv,  PixelFormat::kUyvy,
      PixelFormat::kRgb24, PixelFormat::kI422,  PixelFormat::kMjpeg,  PixelFormat::kRggb8, PixelFormat::kGrbg8,
      PixelFormat::kGbrg8, PixelFormat::kBggr8, PixelFormat::kYuv411, PixelFormat::kMjpeg};
  nature.raymap = kRaymaps[random.below(kRaymaps.size())];
  for (HeadNature& head : nature.head) {
    const auto fits = [&](PixelFormat format) {
      // Only formats with a sample for every pixel are taken apart into fields.
      const bool fields = component_count(format) == 3 || format == PixelFormat::kGrey8;
      return blended_format(format, nature.raymap) && (fields || nature.fields == Fields::kProgressive);
    };
    do head.pixels = kHeads[random.below(kHeads.size())];
    while (!fits(head.pixels));
    if (has_chroma(head.pixels)) head.coding = {random.chance(500'000), random.chance(500'000)};
  }
}

}  // namespace

std::string_view name_of(HeadFault fault) {
  constexpr std::array<std::string_view, kHeadFaults> names = {
      "loses frames",   "corrupts",       "tears",      "no signal",     "duplicates",
      "delivers late",  "stalls",         "unplugged",  "wrong size",    "stuck exposure",
      "sequence wraps", "starts at zero", "time wraps", "misses pulses", "deaf"};
  return names[static_cast<std::size_t>(fault)];
}

std::string_view name_of(HeadState state) {
  constexpr std::array<std::string_view, kHeadStates> names = {"away", "starting", "free", "triggered", "silent"};
  return names[static_cast<std::size_t>(state)];
}

std::string_view name_of(HowMany many) {
  constexpr std::array<std::string_view, kHowMany> names = {"one", "two", "all"};
  return names[static_cast<std::size_t>(many)];
}

std::string_view name_of(RigFault fault) {
  constexpr std::array<std::string_view, kRigFaults> names = {
      "pulses missing", "pulses unseen",  "extra pulses", "trigger drifts",       "trigger gone",   "clock step",
      "suspend",        "capture stalls", "blend stalls", "keeper stalls",        "control stalls", "disk full",
      "disk fails",     "disk slow",      "killed",       "power loss",           "link split",     "link reset",
      "link stalls",    "link replays",   "link flips",   "host gone mid-upload", "storm"};
  return names[static_cast<std::size_t>(fault)];
}

Nature draw_nature(std::uint64_t seed, const DrawOptions& options) {
  hal::sim::Random random(seed, "nature");
  Nature nature;
  nature.seed = seed;
  nature.heads = options.heads ? options.heads : 2 + static_cast<int>(random.below(random.chance(300'000) ? 15 : 7));
  nature.rate = options.ntsc ? FrameRate{} : draw_rate(random);
  nature.genlocked = options.ntsc || random.chance(600'000);
  nature.hosts = options.faults && random.chance(500'000);
  nature.look_every = Duration::milliseconds(10);
  nature.poll = Duration::microseconds(500 + 500 * static_cast<std::int64_t>(random.below(4)));
  nature.blend_every = 8 + static_cast<int>(random.below(24));
  nature.trigger.drift_ppb = 50'000 - static_cast<std::int64_t>(random.below(100'001));
  nature.trigger.jitter = random.chance(500'000) ? Duration::microseconds(200) : Duration::microseconds(2);
  // Either the exposures have up to 0.2 ms of jitter, or their timestamps; both together would be 0.8 ms between two
  // heads, which prevents lock.
  const bool exposures_jitter = random.chance(500'000);
  const Duration jitter = up_to(random, Duration::microseconds(200));
  hal::sim::Random interlaced(seed, "fields");
  if (!options.ntsc && interlaced.chance(250'000)) {
    nature.fields = interlaced.chance(500'000) ? Fields::kTopFirst : Fields::kBottomFirst;
  }
  for (int i = 0; i < nature.heads; ++i) {
    HeadNature head;
    head.rate = nature.rate;
    head.fields = nature.fields;
    head.buffers = 6 + static_cast<int>(random.below(5));
    head.latency = up_to(random, Duration::microseconds(40));
    head.latency_jitter = exposures_jitter ? jitter : Duration::microseconds(1);
    head.clock_jitter = exposures_jitter ? Duration::microseconds(1) : jitter;
    head.readout = nature.rate.period() / 4 + up_to(random, nature.rate.period() / 4);
    head.drift_ppm = 50 - static_cast<std::int32_t>(random.below(101));
    head.control_latency = static_cast<int>(random.below(4));
    nature.head.push_back(head);
  }
  hal::sim::Random reader(seed, "reader");
  if (reader.chance(250'000)) nature.reader = draw_reader(reader);
  hal::sim::Random hostile(seed, "hostile");
  nature.hostile = options.faults && (options.hostile || hostile.chance(125'000));
  hal::sim::Random alignment(seed, "alignment");
  if (!options.ntsc && alignment.chance(250'000)) draw_alignment(alignment, nature);
  hal::sim::Random formats(seed, "formats");
  draw_formats(formats, nature);
  hal::sim::Random wiring(seed, "wiring");
  if (!nature.aligned && wiring.chance(333'333)) {
    const bool all = wiring.chance(500'000);
    for (HeadNature& head : nature.head) {
      head.wired = all || wiring.chance(500'000);
      if (head.wired) head.delay = up_to(wiring, nature.rate.period() / 3);
    }
  }
  return nature;
}

firmware::RigConfig config_of(const Nature& nature) {
  firmware::RigConfig config;
  config.name = "swarm";
  config.rate = nature.rate;
  config.raymap.width = 16;
  config.raymap.height = 8;
  config.raymap.format = nature.raymap;
  if (nature.fields != Fields::kProgressive) config.raymap.fields = FieldUse::kSeparate;
  config.trigger.start = nature.genlocked;
  if (nature.aligned) config.trigger.source = firmware::SyncSource::kNone;
  for (int i = 0; i < nature.heads; ++i) {
    firmware::HeadConfig head;
    head.name = "cam" + std::to_string(i);
    head.port = {firmware::PortKind::kSim, head.name};
    head.format = nature.head[static_cast<std::size_t>(i)].pixels;
    head.fields = nature.fields;
    head.wired = nature.head[static_cast<std::size_t>(i)].wired;
    head.trigger_delay = nature.head[static_cast<std::size_t>(i)].delay;
    config.heads.push_back(head);
  }
  return config;
}

Calibration calibration_of(const Nature& nature, int which) {
  // Forward, right, back, left, and again, with numbers that all machines serialize alike.
  constexpr std::array<std::array<double, 9>, 4> kLooks = {{{1, 0, 0, 0, 1, 0, 0, 0, 1},
                                                            {0, 0, -1, 0, 1, 0, 1, 0, 0},
                                                            {-1, 0, 0, 0, 1, 0, 0, 0, -1},
                                                            {0, 0, 1, 0, 1, 0, -1, 0, 0}}};
  Calibration calibration;
  calibration.name = which == 0 ? "first" : "second";
  for (int i = 0; i < nature.heads; ++i) {
    HeadCalibration head;
    head.name = "cam" + std::to_string(i);
    head.width = kPictureWidth;
    head.height = kPictureHeight;
    head.center_x = kPictureWidth / 2.0;
    head.center_y = kPictureHeight / 2.0;
    head.lens = RectilinearLens{{kPictureWidth / 2.0}};
    head.R_head_rig = kLooks[static_cast<std::size_t>(i) % kLooks.size()];
    head.region = {0, kFirstBlended, kPictureWidth, kPictureHeight, std::nullopt};
    head.vignetting = {kPictureWidth / 2.0, kPictureHeight / 2.0, kPictureWidth / 2.0, {}};
    if (which == 1) head.gain = {2, 2, 2};
    calibration.heads.push_back(head);
  }
  return calibration;
}

}  // namespace nodal::swarm
