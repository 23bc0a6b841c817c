// The panel's lines: lamps that return to their safe level when a lease ends, and buttons whose level is never lost.
#pragma once

#include <array>
#include <atomic>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "hal/linux/gpio/output_line.h"
#include "hal/linux/gpio/system.h"
#include "hal/pin.h"
#include "protocol/base/spsc_ring.h"

namespace nodal::hal::gpio {

/// A thread of Pins makes every call of the line's driver. It ends leases on time even if step() is not called.
///
/// Threading: as OutputPinPort. Ownership: see Pins.
/// Errors: kDeviceGone when the chip is gone, kDeviceFailed after kRefusedInRow refused writes; both are final.
class GpioOutputPin final : public OutputPinPort {
 public:
  static constexpr int kRefusedInRow = 5;

  GpioOutputPin(std::unique_ptr<OutputLine> line, bool active_low) : line_(std::move(line)), active_low_(active_low) {}
  Status set(bool high, Instant now, Duration lease) override;
  Status step(Instant now) override;
  void make_safe() noexcept override { line_->make_safe(); }

  // Pins'.
  void attach(Runner* runner) { runner_ = runner; }
  /// On the thread: writes what is due; returns when the lease ends.
  Instant work(Instant now);

 private:
  const std::unique_ptr<OutputLine> line_;
  const bool active_low_;
  Runner* runner_ = nullptr;
  /// The time at which the wanted level ends, shifted left, and the level: one value, so that no lock is needed.
  std::atomic<std::int64_t> wanted_{0};
  std::atomic<int> error_{0};  ///< final
  bool written_ = false;       ///< the thread's: the newest level, before inversion
  int refused_ = 0;            ///< the thread's: writes in a row
};

/// After every batch of events the level is read again, because the kernel keeps only 16 edges of a burst: the edges
/// that were discarded are not reported, but the level after the burst always is.
///
/// Threading: as InputPinPort. Ownership: see Pins.
/// Errors: kDeviceGone when the chip is gone, kDeviceFailed when a read is refused; both are final.
class GpioInputPin final : public InputPinPort {
 public:
  static constexpr std::size_t kEdgesKept = 256;

  GpioInputPin(LineName name, std::unique_ptr<Line> line, System& system)
      : name_(std::move(name)), line_(std::move(line)), system_(system), edges_(kEdgesKept) {}
  Result<bool> level() override;
  Result<std::optional<PinEdge>> take_edge() override;
  /// Bursts in which edges were discarded, by the kernel or because take_edge() was not called in time.
  std::uint64_t bursts() const { return bursts_.load(); }

  // Pins'.
  Line& line() { return *line_; }
  /// Before the thread starts: the present level is no edge. 0 or an errno.
  int prime();
  /// On the thread: reads what there is; returns when to look again although no event came.
  Instant work(Instant now);

 private:
  Status check_present() const;
  int report_events();
  void report(Instant at, bool high);

  const LineName name_;
  const std::unique_ptr<Line> line_;
  System& system_;
  SpscRing<PinEdge> edges_;
  std::atomic<bool> level_{false};
  std::atomic<int> error_{0};  ///< final
  std::atomic<std::uint64_t> bursts_{0};
  // The thread's.
  bool reported_ = false;  ///< the level after the newest edge in edges_
  Instant newest_;         ///< time of the newest edge
  bool lost_edges_ = false;
};

/// What to claim.
struct PinRequest {
  LineName line;
  bool active_low = false;
  Bias bias = Bias::kAsIs;  ///< bias of an input
};

/// Claims lines and drives them with one thread.
///
/// Threading: made and destroyed by one thread, after which the pins are thread-bound to their stage.
/// Ownership: owns the pins; the system outlives it.
/// Errors: claims are explain_claim()'s; start() is kOverload when the system refuses the thread.
class Pins {
 public:
  explicit Pins(System& system) : system_(system) {}
  ~Pins();

  /// Call these before start(). An output is off until it is set.
  Result<GpioOutputPin*> add_output(const PinRequest& request);
  Result<GpioInputPin*> add_input(const PinRequest& request);
  Status start();
  void make_safe() noexcept;

 private:
  Instant step(Instant now);

  System& system_;
  std::deque<GpioOutputPin> outputs_;
  std::deque<GpioInputPin> inputs_;
  std::unique_ptr<Runner> runner_;
};

}  // namespace nodal::hal::gpio
