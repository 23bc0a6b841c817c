// An emulated IIDC camera on an emulated bus, in virtual time, with faults.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "hal/clock.h"
#include "hal/linux/iidc/bus.h"
#include "hal/sim/trigger.h"
#include "tests/support/iidc_registers.h"

namespace nodal::test {

/// One camera. In free run frame n of a stream is complete n + 1 periods after the stream's start; where pulses reach
/// it, it follows them, as a genlocked camera does. With its trigger on, a pulse starts an exposure. A new shutter or
/// gain is in the third frame that begins after it was written. Every byte of a picture is the frame's number, but for
/// the embedded ones.
///
/// Threading: thread-safe.
class IidcBus final : public hal::iidc::Bus, public hal::sim::PulseSink {
 public:
  static constexpr std::uint64_t kGuid = 0x00B0'9D01'00C0'FFEE;
  static constexpr int kDescriptor = 2000;                         ///< what its source waits for; of no file
  static constexpr Duration kReadout = Duration::milliseconds(2);  ///< from an exposure's end to its frame's last byte

  explicit IidcBus(hal::ClockPort& clock) : clock_(clock) {}

  // How it is, before it is opened.
  IidcRegisters registers;
  std::optional<hal::device::UsbPlace> usb = hal::device::UsbPlace{3, 480, 480, "1"};

  // Faults. The functions may block, and are called without a lock; set them while nothing uses the camera.
  std::function<int(std::uint64_t offset)> before_read;                        ///< an errno makes it fail
  std::function<int(std::uint64_t offset, std::uint32_t value)> before_write;  ///< an errno makes it fail
  void ignore_writes(std::uint32_t offset);  ///< to a command register: it is acknowledged and does nothing
  void lose(std::uint32_t frame);            ///< the camera counts it and does not send it
  void tear(std::uint32_t frame);            ///< half of it arrives
  void damage(std::uint32_t frame);
  void displace();  ///< from now on its pictures begin in the middle of a transfer, until the stream begins again
  void jump_counter(std::uint32_t by);  ///< its embedded counter is wrong from now on
  void fall_silent(bool on);
  void break_stream(int takes);      ///< so many takes fail with EIO
  void refuse_buffers(int buffers);  ///< so many are not accepted
  void refuse_opening(int error) { opening_error_ = error; }
  void unplug();
  void plug_in();

  // What it did.
  std::uint32_t frames_exposed() const;
  bool transmits() const;
  bool triggered() const;
  float shutter() const;  ///< seconds
  int open_devices() const;
  int sources() const;
  bool readable();  ///< what poll() says of the descriptor

  int open(std::uint64_t guid, std::unique_ptr<hal::iidc::Device>& device) override;
  std::vector<hal::iidc::CameraInfo> list() override;
  void on_pulse(std::uint64_t number, Instant at) override;
  void on_unseen(std::uint64_t) override {}

 private:
  class OpenCamera;
  class Source;
  struct Frame {
    std::uint32_t number = 0;
    Instant done;
    std::uint32_t shutter = 0, gain = 0;
  };
  struct Slot {
    std::vector<std::uint8_t> bytes;
    enum class State { kIdle, kQueued, kLent } state = State::kIdle;
    bool starved = false;
  };
  struct Change {
    Instant at;
    std::uint32_t shutter, gain;
    int frames_left = 2;
  };
  struct Done {
    std::size_t slot;
    Frame frame;
    bool starved;
  };

  int read(std::uint64_t offset, std::uint32_t& value, int generation);
  int write(std::uint64_t offset, std::uint32_t value, int generation);
  void expose_until(Instant now);
  void expose(Instant done);
  void deliver(Instant now);
  void fill(Slot& slot, const Frame& frame);
  Duration period() const;
  Duration exposure() const;
  bool gone(int generation) const { return !there_ || generation != generation_; }

  hal::ClockPort& clock_;
  mutable std::mutex mutex_;
  bool there_ = true;
  int generation_ = 0;  ///< counts how often it was plugged in
  int opening_error_ = 0, open_ = 0, sources_ = 0;
  std::set<std::uint64_t> ignored_;
  std::set<std::uint32_t> lost_, torn_, damaged_;
  std::uint32_t jumped_ = 0;
  bool silent_ = false, displaced_ = false;
  int broken_takes_ = 0, refused_buffers_ = 0;

  bool streams_ = false;
  Instant next_done_;                      ///< end of the next frame in free run
  std::optional<Instant> own_clock_from_;  ///< pulses determine the frames until then
  std::uint32_t number_ = 0;
  std::uint32_t shutter_ = 0, gain_ = 0;  ///< settings in effect, as the registers have them
  std::deque<Change> changes_;
  std::deque<Frame> coming_;  ///< exposed, not yet transferred

  std::vector<Slot>* slots_ = nullptr;  ///< slots of the source that is queued
  std::deque<std::size_t> queue_;
  std::deque<Done> done_;
  bool starved_ = false;
};

}  // namespace nodal::test
