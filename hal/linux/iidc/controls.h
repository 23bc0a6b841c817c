// An IIDC camera's exposure, gain and white balance.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "hal/head.h"
#include "hal/linux/device/controls.h"
#include "hal/linux/iidc/negotiation.h"

namespace nodal::hal::iidc {

/// Exposure is the absolute shutter, in seconds; a camera without absolute values has a fixed one. Gain is absolute, in
/// decibels, or `gain_step_mdb` per step. White balance has no unit: the middle of its range counts as 1.0. With
/// trigger.pulse_width the pulse is the exposure, and in free run the shutter that the camera came with.
///
/// Threading: find(), read(), set() and set_triggered() on the worker, and the first three may take seconds;
/// exposure_of() and gain_of() on any thread.
class Controls {
 public:
  /// Finds the features and switches off automatic modes.
  static Result<std::unique_ptr<Controls>> find(Camera& camera, const HeadRequest& request);

  const HeadLimits& limits() const { return limits_; }
  Result<HeadSettings> read(Camera& camera);
  Status set(Camera& camera, const device::ControlChange& change);
  /// Whether pulses start the exposures of the next stream.
  void set_triggered(bool on) { triggered_ = on; }

  /// What a register's value in a frame stands for, if that value was read together with the absolute one. Registers
  /// count in units of the camera's own, so only values that were in effect are known.
  std::optional<Exposure> exposure_of(std::uint32_t shutter_register) const { return shutters_.find(shutter_register); }
  std::optional<Gain> gain_of(std::uint32_t gain_register) const { return gains_.find(gain_register); }

 private:
  /// The newest pairs.
  template <class Value>
  class Known {
   public:
    void add(std::uint32_t raw, Value value) {
      const std::lock_guard lock(mutex_);
      for (auto& [known, its] : pairs_) {
        if (known != raw) continue;
        its = value;
        return;
      }
      pairs_[next_++ % pairs_.size()] = {raw, value};
    }
    std::optional<Value> find(std::uint32_t raw) const {
      const std::lock_guard lock(mutex_);
      for (const auto& [known, value] : pairs_) {
        if (known == raw) return value;
      }
      return std::nullopt;
    }

   private:
    static constexpr std::uint32_t kNone = ~0U;  // registers have 12 bits
    mutable std::mutex mutex_;
    std::array<std::pair<std::uint32_t, Value>, 16> pairs_ = [] {
      std::array<std::pair<std::uint32_t, Value>, 16> none{};
      for (auto& pair : none) pair.first = kNone;
      return none;
    }();
    std::size_t next_ = 0;
  };

  Controls() = default;
  Gain gain_in(const Feature& feature) const;

  HeadLimits limits_;
  std::int32_t gain_step_mdb_ = 0;
  std::optional<Feature> shutter_, gain_, balance_;  ///< those that can be set, as they were found
  std::optional<Exposure> by_pulse_;                 ///< the exposure, when the pulse determines it
  bool triggered_ = false;
  Known<Exposure> shutters_;
  Known<Gain> gains_;
};

}  // namespace nodal::hal::iidc
