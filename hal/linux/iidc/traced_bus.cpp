#include "hal/linux/iidc/traced_bus.h"

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <string_view>
#include <utility>

#include "hal/linux/iidc/camera.h"
#include "hal/linux/iidc/registers.h"

namespace nodal::hal::iidc {
namespace {

constexpr Duration kMissingEvery = Duration::seconds(1);

struct Named {
  std::uint32_t offset;
  std::string_view name;
};
/// Registers of IIDC 1.31 that Camera uses, in the specification's words.
constexpr std::array kNames = std::to_array<Named>({
    {reg::kInitialize, "INITIALIZE"},
    {reg::kFormats, "V_FORMAT_INQ"},
    {reg::kBasicFunctions, "BASIC_FUNC_INQ"},
    {reg::kFeaturesPresent, "FEATURE_HI_INQ"},
    {reg::kRate, "CUR_V_FRM_RATE"},
    {reg::kMode, "CUR_V_MODE"},
    {reg::kFormat, "CUR_V_FORMAT"},
    {reg::kIsoChannel, "ISO_CHANNEL"},
    {reg::kPower, "CAMERA_POWER"},
    {reg::kTransmit, "ISO_EN"},
    {reg::kModeError, "VMODE_ERROR_STATUS"},
    {reg::kFrameInfo, "FRAME_INFO"},
});
constexpr std::array<std::string_view, 16> kFeatureNames = {
    "BRIGHTNESS",   "AUTO_EXPOSURE", "SHARPNESS", "WHITE_BALANCE", "HUE",   "SATURATION",
    "GAMMA",        "SHUTTER",       "GAIN",      "IRIS",          "FOCUS", "TEMPERATURE",
    "TRIGGER_MODE", "TRIGGER_DELAY", "WHITE_SHD", "FRAME_RATE"};

/// The feature of a register in a table of one register a feature; empty when `offset` is not in it.
std::string feature_name(std::uint32_t offset, std::uint32_t table, std::string_view suffix) {
  if (offset < table || offset >= table + 4 * kFeatureNames.size() || offset % 4 != 0) return {};
  return fmt::format("{}{}", kFeatureNames[(offset - table) / 4], suffix);
}

std::string result_text(int error) {
  return error == 0 ? std::string() : fmt::format(" -> {}", ::strerrordesc_np(error));
}

class TracedSource final : public FrameSource {
 public:
  TracedSource(std::unique_ptr<FrameSource> source, std::string name, ClockPort& clock, TraceLine write)
      : source_(std::move(source)), name_(std::move(name)), clock_(clock), write_(std::move(write)) {}

  int begin() override {
    const int error = source_->begin();
    write_(fmt::format("{}: begin to receive frames{}", name_, result_text(error)));
    frame_ = line_ = clock_.now();
    return error;
  }
  void end() override {
    source_->end();
    write_(name_ + ": end");
  }
  int take(RawFrame& frame) override {
    const int error = source_->take(frame);
    const Instant now = clock_.now();
    if (error == EAGAIN) {
      ++asked_;
      if (now - line_ < kMissingEvery) return error;
      line_ = now;
      write_(
          fmt::format("{}: no frame for {} ms, asked {} times", name_, (now - frame_).ms(), std::exchange(asked_, 0)));
      return error;
    }
    frame_ = line_ = now;
    asked_ = 0;
    if (error != 0) {
      write_(fmt::format("{}: take a frame{}", name_, result_text(error)));
      return error;
    }
    write_(fmt::format("{}: frame in buffer {}, {} bytes{}{}", name_, frame.slot, frame.bytes,
                       frame.damaged ? ", damaged" : "",
                       frame.starved || frame.discarded > 0 ? ", frames before it found no buffer" : ""));
    return error;
  }
  int give_back(std::size_t slot) override {
    const int error = source_->give_back(slot);
    if (error != 0) write_(fmt::format("{}: give buffer {} back{}", name_, slot, result_text(error)));
    return error;
  }
  std::size_t buffers() const override { return source_->buffers(); }
  void add_wake_ups(WakeUps& to) const override { source_->add_wake_ups(to); }

 private:
  const std::unique_ptr<FrameSource> source_;
  const std::string name_;
  ClockPort& clock_;
  const TraceLine write_;
  Instant frame_;  ///< when the newest frame came, or the stream began
  Instant line_;   ///< when a missing frame was written last, or as frame_
  int asked_ = 0;  ///< calls without a frame since the last line about them
};

class TracedDevice final : public Device {
 public:
  TracedDevice(std::unique_ptr<Device> device, ClockPort& clock, TraceLine write)
      : device_(std::move(device)), name_(port_of(device_->info().guid)), clock_(clock), write_(std::move(write)) {}

  const CameraInfo& info() const override { return device_->info(); }
  int read(std::uint64_t offset, std::uint32_t& value) override {
    const int error = device_->read(offset, value);
    write_(fmt::format("{}: read {}{}", name_, name_of(offset),
                       error == 0 ? fmt::format(" -> {:08X}h", value) : result_text(error)));
    return error;
  }
  int write(std::uint64_t offset, std::uint32_t value) override {
    const int error = device_->write(offset, value);
    write_(fmt::format("{}: write {} = {:08X}h{}", name_, name_of(offset), value, result_text(error)));
    return error;
  }
  bool gone() const override { return device_->gone(); }
  int make_source(std::size_t buffers, std::size_t frame_bytes, std::unique_ptr<FrameSource>& source) override {
    const int error = device_->make_source(buffers, frame_bytes, source);
    write_(fmt::format("{}: {} buffers for frames of {} bytes{}", name_, buffers, frame_bytes, result_text(error)));
    if (error == 0) source = std::make_unique<TracedSource>(std::move(source), name_, clock_, write_);
    return error;
  }

 private:
  std::string name_of(std::uint64_t offset) const { return register_name(offset, info().command_base); }

  const std::unique_ptr<Device> device_;
  const std::string name_;
  ClockPort& clock_;
  const TraceLine write_;
};

}  // namespace

std::string register_name(std::uint64_t offset, std::uint64_t command_base) {
  if (offset < command_base || offset - command_base > reg::kFrameInfo) return fmt::format("{:X}h", offset);
  const auto from_base = static_cast<std::uint32_t>(offset - command_base);
  for (const Named& each : kNames) {
    if (each.offset == from_base) return std::string(each.name);
  }
  for (const auto& [table, suffix] : {std::pair{reg::kFeatureInquiries, "_INQ"}, std::pair{reg::kFeatures, ""},
                                      std::pair{reg::kAbsolutePlaces, "_ABS_CSR_INQ"}}) {
    if (std::string name = feature_name(from_base, table, suffix); !name.empty()) return name;
  }
  if (from_base >= reg::kModes && from_base < reg::kRates) {
    return fmt::format("V_MODE_INQ_{}", (from_base - reg::kModes) / 4);
  }
  if (from_base >= reg::kRates && from_base < reg::kFormat7Places) {
    return fmt::format("V_RATE_INQ_{}_{}", (from_base - reg::kRates) / 32, (from_base - reg::kRates) % 32 / 4);
  }
  if (from_base >= reg::kFormat7Places && from_base < reg::kBasicFunctions) {
    return fmt::format("V_CSR_INQ_7_{}", (from_base - reg::kFormat7Places) / 4);
  }
  return fmt::format("{:X}h", offset);
}

int TracedBus::open(std::uint64_t guid, std::unique_ptr<Device>& device) {
  const int error = bus_.open(guid, device);
  write_(fmt::format("{}: open{}", port_of(guid), result_text(error)));
  if (error == 0) device = std::make_unique<TracedDevice>(std::move(device), clock_, write_);
  return error;
}

std::vector<CameraInfo> TracedBus::list() {
  std::vector<CameraInfo> found = bus_.list();
  write_(fmt::format("the bus has {} cameras", found.size()));
  for (const CameraInfo& camera : found) {
    write_(fmt::format("{}: {} {}", port_of(camera.guid), camera.vendor, camera.model));
  }
  return found;
}

}  // namespace nodal::hal::iidc
