#include "hal/replay/deck.h"
#include "hal/sim/rig.h"
#include "head_conformance.h"
#include "stitch/media/image_file.h"
#include "stitch/media/picture_folder.h"
#include "tests/support/pictures.h"
#include "tests/support/rigs.h"

namespace nodal::hal {

namespace {

class SimHeadWorld final : public HeadWorld {
 public:
  explicit SimHeadWorld(const sim::HeadOptions& head) : world_(test::ring(2, 48, 32), options(head)) {}

  HeadEnumerator& enumerator() override { return world_.enumerator(); }
  std::string path() override { return "sim:cam1"; }
  ClockPort& clock() override { return world_.clock(); }
  void pass(Duration time) override { world_.clock().advance(time); }
  TriggerPort* trigger() override { return &world_.trigger(); }
  bool unplug() override {
    world_.head(1).unplug();
    return true;
  }
  bool replug() override {
    world_.head(1).replug();
    return true;
  }

 private:
  static sim::SimRigOptions options(const sim::HeadOptions& head) {
    sim::SimRigOptions options;
    options.head = head;
    return options;
  }
  sim::SimRig world_;
};

HeadWorldKind sim_kind(const std::string& name, const std::function<void(sim::HeadOptions&)>& adjust) {
  return {name, [adjust] {
            sim::HeadOptions head;
            adjust(head);
            return std::make_unique<SimHeadWorld>(head);
          }};
}

/// A head that plays picture files.
class ReplayHeadWorld final : public HeadWorld {
 public:
  ReplayHeadWorld(const std::string& name, int files, std::uint64_t keep_bytes, std::optional<PixelFormat> as)
      : name_(name) {
    for (int i = 0; i < files; ++i) {
      const auto rgb = test::smooth_rgb(40, 24, i);
      if (name.find("jpg") != std::string::npos) {
        test::write_bytes(folder_ / ("a" + std::to_string(i) + ".jpg"),
                          test::jpeg_of(rgb, 40, 24, test::Sampling::k420));
      } else {
        test::write_bytes(folder_ / ("a" + std::to_string(i) + ".png"), test::png_of(rgb, 40, 24, 3));
      }
    }
    replay::DeckOptions options;
    options.pictures = {media::read_image_header, media::read_image, media::jpegs_and_pngs_in};
    options.base = folder_.path();
    options.keep_bytes = keep_bytes;
    deck_ = std::make_unique<replay::Deck>(clock_, options);
    if (as) deck_->want_format(path(), *as);
  }

  HeadEnumerator& enumerator() override { return deck_->enumerator(); }
  std::string path() override { return "replay:" + name_; }
  ClockPort& clock() override { return clock_; }
  void pass(Duration time) override { clock_.advance(time); }
  TriggerPort* trigger() override { return &deck_->trigger(); }

 private:
  const std::string name_;
  test::TemporaryFolder folder_;
  sim::SimClock clock_;
  std::unique_ptr<replay::Deck> deck_;
};

HeadWorldKind replay_kind(const std::string& name, const std::string& path, int files, std::uint64_t keep,
                          std::optional<PixelFormat> as = std::nullopt) {
  return {name, [=] { return std::make_unique<ReplayHeadWorld>(path, files, keep, as); }};
}

INSTANTIATE_TEST_SUITE_P(
    Sim, HeadConformance,
    testing::Values(sim_kind("I420", [](sim::HeadOptions&) {}),
                    sim_kind("YuyvNoisy",
                             [](sim::HeadOptions& head) {
                               head.pixels = PixelFormat::kYuyv;
                               head.noise.levels = 2;
                               head.noise.full_well_electrons = 20'000;
                             }),
                    sim_kind("GreyNoLatencyDrifting",
                             [](sim::HeadOptions& head) {
                               head.pixels = PixelFormat::kGrey8;
                               head.limits.control_latency_frames = 0;
                               head.limits.nudge = {Duration::microseconds(125), {}, Duration::milliseconds(1), 1};
                               head.free_run_drift_ppm = 150;
                             }),
                    sim_kind("Rgb24Plain",
                             [](sim::HeadOptions& head) {
                               head.pixels = PixelFormat::kRgb24;
                               head.limits.has_trigger_input = false;
                               head.limits.has_white_balance = false;
                               head.limits.nudge = {};
                             }),
                    sim_kind("Mjpeg", [](sim::HeadOptions& head) { head.pixels = PixelFormat::kMjpeg; }),
                    sim_kind("Bayer", [](sim::HeadOptions& head) { head.pixels = PixelFormat::kGbrg8; }),
                    sim_kind("Nv12Interlaced",
                             [](sim::HeadOptions& head) {
                               head.pixels = PixelFormat::kNv12;
                               head.fields = Fields::kBottomFirst;
                               head.limits.control_latency_frames = 5;
                             })),
    [](const auto& kind) { return kind.param.name; });

INSTANTIATE_TEST_SUITE_P(Replay, HeadConformance,
                         testing::Values(replay_kind("StillPng", "a0.png", 1, 1 << 20),
                                         replay_kind("SequenceOfJpegs", "a*.jpg", 7, 1 << 20),
                                         replay_kind("JpegsAsTheyAre", "a*.jpg", 3, 1 << 20, PixelFormat::kMjpeg),
                                         replay_kind("SequenceDecodedEachTime", "a*.png", 9, 1)),
                         [](const auto& kind) { return kind.param.name; });

}  // namespace
}  // namespace nodal::hal
