#include "hal/linux/iidc/ring_source.h"

#include <poll.h>
#include <time.h>

#include <algorithm>
#include <cerrno>
#include <vector>

#include "hal/linux/clock.h"
#include "protocol/base/result.h"

namespace nodal::hal::iidc {
namespace {

constexpr std::uint32_t kRingBuffers = 4;

/// The ring's timestamps are CLOCK_REALTIME in microseconds; the rig's clock is CLOCK_MONOTONIC. 0: the kernel gave
/// none.
Instant on_rigs_clock(std::uint64_t real_us, Instant now) {
  timespec real{};
  ::clock_gettime(CLOCK_REALTIME, &real);
  const std::int64_t ago =
      std::int64_t{real.tv_sec} * 1'000'000 + real.tv_nsec / 1'000 - static_cast<std::int64_t>(real_us);
  // Older timestamps, and those from the future: the wall clock was set in between.
  constexpr std::int64_t kLongestAgoUs = 10'000'000;
  return real_us == 0 || ago < 0 || ago > kLongestAgoUs ? now : now - Duration::microseconds(ago);
}

class RingSource final : public FrameSource {
 public:
  RingSource(dc1394camera_t* camera, std::size_t buffers, std::size_t frame_bytes)
      : camera_(camera), slots_(buffers), frame_bytes_(frame_bytes) {
    for (Slot& slot : slots_) slot.memory = std::make_unique<std::uint8_t[]>(frame_bytes);
  }
  ~RingSource() override { end(); }
  RingSource(const RingSource&) = delete;
  RingSource& operator=(const RingSource&) = delete;

  int begin() override {
    discarded_ = 0;
    switch (dc1394_capture_setup(camera_, kRingBuffers, DC1394_CAPTURE_FLAGS_DEFAULT)) {
      case DC1394_SUCCESS: running_ = true; return 0;
      case DC1394_NO_ISO_CHANNEL:
      case DC1394_NO_BANDWIDTH: return ENOSPC;
      case DC1394_MEMORY_ALLOCATION_FAILURE: return ENOMEM;
      case DC1394_CAPTURE_IS_RUNNING: return EBUSY;
      default: return EIO;
    }
  }

  void end() override {
    if (running_) dc1394_capture_stop(camera_);
    running_ = false;
  }

  int take(RawFrame& frame) override {
    for (;;) {
      dc1394video_frame_t* raw = nullptr;
      const bool failed = dc1394_capture_dequeue(camera_, DC1394_CAPTURE_POLICY_POLL, &raw) != DC1394_SUCCESS;
      if (failed) return broken();
      if (raw == nullptr) return EAGAIN;
      const auto free = std::find_if(slots_.begin(), slots_.end(), [](const Slot& slot) { return !slot.lent; });
      const bool kept = free != slots_.end();
      if (kept) {
        free->lent = true;
        const std::size_t bytes = std::min<std::size_t>(raw->image_bytes, frame_bytes_);
        std::copy_n(raw->image, bytes, free->memory.get());
        frame = {static_cast<std::size_t>(free - slots_.begin()),
                 free->memory.get(),
                 bytes,
                 on_rigs_clock(raw->timestamp, clock_.now()),
                 raw->timestamp != 0,
                 dc1394_capture_is_frame_corrupt(camera_, raw) == DC1394_TRUE,
                 std::exchange(discarded_, 0U),
                 false};
      } else {
        ++discarded_;
      }
      const bool returned = dc1394_capture_enqueue(camera_, raw) == DC1394_SUCCESS;
      if (kept) {
        stuck_ = !returned;
        return 0;
      }
      if (!returned) return broken();
    }
  }

  int give_back(std::size_t slot) override {
    NODAL_ASSERT(slots_[slot].lent);
    slots_[slot].lent = false;
    return 0;
  }

  std::size_t buffers() const override { return slots_.size(); }

  void add_wake_ups(WakeUps& to) const override {
    if (stuck_) to.at(Instant());
    if (running_) to.on({dc1394_capture_get_fileno(camera_), true, false});
  }

 private:
  struct Slot {
    std::unique_ptr<std::uint8_t[]> memory;
    bool lent = false;
  };

  /// After its camera was unplugged the kernel reports an error on the ring's descriptor.
  int broken() const {
    pollfd ring{dc1394_capture_get_fileno(camera_), POLLIN, 0};
    return ::poll(&ring, 1, 0) > 0 && (ring.revents & (POLLERR | POLLHUP)) != 0 ? ENODEV : EIO;
  }

  dc1394camera_t* const camera_;
  std::vector<Slot> slots_;
  const std::size_t frame_bytes_;
  linux_os::LinuxClock clock_;
  bool running_ = false;
  bool stuck_ = false;  ///< the ring did not accept a buffer
  std::uint32_t discarded_ = 0;
};

}  // namespace

std::unique_ptr<FrameSource> make_ring_source(dc1394camera_t* camera, std::size_t buffers, std::size_t frame_bytes) {
  return std::make_unique<RingSource>(camera, buffers, frame_bytes);
}

}  // namespace nodal::hal::iidc
