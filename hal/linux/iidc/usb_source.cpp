#include "hal/linux/iidc/usb_source.h"

#include <libusb.h>
#include <poll.h>
#include <sys/time.h>

#include <algorithm>
#include <cerrno>
#include <deque>
#include <vector>

#include "hal/linux/clock.h"
#include "protocol/base/result.h"

namespace nodal::hal::iidc {
namespace {

constexpr std::uint8_t kEndpoint = 0x81;  ///< the endpoint that every USB camera known to libdc1394 has
constexpr unsigned kDrainMs = 20;
constexpr int kMaxDrains = 64;

int errno_of(int libusb_error) {
  switch (libusb_error) {
    case LIBUSB_SUCCESS: return 0;
    case LIBUSB_ERROR_NO_DEVICE:
    case LIBUSB_ERROR_NOT_FOUND: return ENODEV;
    case LIBUSB_ERROR_ACCESS: return EACCES;
    case LIBUSB_ERROR_BUSY: return EBUSY;
    case LIBUSB_ERROR_NO_MEM: return ENOMEM;
    default: return EIO;
  }
}

struct Closer {
  void operator()(libusb_context* context) const { libusb_exit(context); }
  void operator()(libusb_device_handle* handle) const { libusb_close(handle); }
  void operator()(libusb_transfer* transfer) const { libusb_free_transfer(transfer); }
};
using UsbContext = std::unique_ptr<libusb_context, Closer>;
using UsbHandle = std::unique_ptr<libusb_device_handle, Closer>;

/// The number of the interface with the stream's endpoint, or -1.
int interface_of(libusb_device* device) {
  libusb_config_descriptor* config = nullptr;
  if (libusb_get_active_config_descriptor(device, &config) != 0) return -1;
  int found = -1;
  for (int i = 0; i < config->bNumInterfaces && found < 0; ++i) {
    if (config->interface[i].num_altsetting < 1) continue;
    const libusb_interface_descriptor& one = config->interface[i].altsetting[0];
    for (int e = 0; e < one.bNumEndpoints; ++e) {
      if (one.endpoint[e].bEndpointAddress == kEndpoint) found = one.bInterfaceNumber;
    }
  }
  libusb_free_config_descriptor(config);
  return found;
}

class UsbSource final : public FrameSource {
 public:
  UsbSource(std::size_t buffers, std::size_t frame_bytes) : slots_(buffers), frame_bytes_(frame_bytes) {}
  ~UsbSource() override {
    end();
    if (handle_ && interface_ >= 0) libusb_release_interface(handle_.get(), interface_);
  }
  UsbSource(const UsbSource&) = delete;
  UsbSource& operator=(const UsbSource&) = delete;

  int open(int bus, int address) {
    libusb_context* context = nullptr;
    if (const int error = libusb_init(&context); error != 0) return errno_of(error);
    context_.reset(context);
    libusb_device** list = nullptr;
    if (libusb_get_device_list(context, &list) < 0) return EIO;
    int error = ENODEV;
    for (libusb_device** one = list; *one != nullptr; ++one) {
      if (libusb_get_bus_number(*one) != bus || libusb_get_device_address(*one) != address) continue;
      libusb_device_handle* handle = nullptr;
      error = errno_of(libusb_open(*one, &handle));
      handle_.reset(handle);
      break;
    }
    libusb_free_device_list(list, 1);
    if (error != 0) return error;
    const int interface = interface_of(libusb_get_device(handle_.get()));
    if (interface < 0) return EIO;
    if (const int claimed = libusb_claim_interface(handle_.get(), interface); claimed != 0) return errno_of(claimed);
    interface_ = interface;
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      Slot& slot = slots_[i];
      // Ordinary memory: on ARM the kernel's memory for transfers is not cached, and reading it is ten times slower.
      slot.memory = std::make_unique<std::uint8_t[]>(frame_bytes_);
      slot.transfer.reset(libusb_alloc_transfer(0));
      if (!slot.transfer) return ENOMEM;
      slot.source = this;
      slot.index = i;
      libusb_fill_bulk_transfer(slot.transfer.get(), handle_.get(), kEndpoint, slot.memory.get(),
                                static_cast<int>(frame_bytes_), done, &slot, 0);
    }
    return 0;
  }

  int begin() override {
    // A program that was killed, or a broken stream, leaves part of a frame in the camera.
    libusb_clear_halt(handle_.get(), kEndpoint);
    drain();
    broken_ = 0;
    starved_ = false;
    for (Slot& slot : slots_) {
      if (slot.state != State::kIdle) continue;
      if (const int error = submit(slot); error != 0) {
        end();
        return error;
      }
    }
    return 0;
  }

  void end() override {
    for (Slot& slot : slots_) {
      if (slot.state == State::kQueued) libusb_cancel_transfer(slot.transfer.get());
    }
    // Without an end: the kernel may write to a transfer that it keeps, so its memory cannot be freed. It ends
    // transfers at once; if it ever does not, only this device's worker waits, and its head counts as missing.
    while (queued() > 0) handle_events(100);
    for (const std::size_t slot : done_) slots_[slot].state = State::kIdle;
    done_.clear();
  }

  int take(RawFrame& frame) override {
    handle_events(0);
    while (!done_.empty()) {
      Slot& slot = slots_[done_.front()];
      done_.pop_front();
      if (slot.bytes == 0 && !slot.damaged) {
        // A packet without bytes, which ends a frame of full packets: no frame.
        slot.state = State::kIdle;
        if (const int error = submit(slot); error != 0) broken_ = error;
        continue;
      }
      slot.state = State::kLent;
      frame = {slot.index, slot.memory.get(), slot.bytes, slot.at, false, slot.damaged, 0, slot.starved};
      return 0;
    }
    return broken_ != 0 ? broken_ : EAGAIN;
  }

  int give_back(std::size_t index) override {
    Slot& slot = slots_[index];
    NODAL_ASSERT(slot.state == State::kLent);
    if (broken_ != 0) {
      slot.state = State::kIdle;  // queued by the restart
      return 0;
    }
    // Before it is queued: a frame that began while nothing was queued is lost.
    handle_events(0);
    if (queued() == 0) starved_ = true;
    const int error = submit(slot);
    if (error != 0) slot.state = State::kLent;
    return error;
  }

  std::size_t buffers() const override { return slots_.size(); }

  void add_wake_ups(WakeUps& to) const override {
    if (!done_.empty()) to.at(Instant());
    const libusb_pollfd** const all = libusb_get_pollfds(context_.get());
    if (all == nullptr) return;
    for (const libusb_pollfd** one = all; *one != nullptr; ++one) {
      to.on({(*one)->fd, ((*one)->events & POLLIN) != 0, ((*one)->events & POLLOUT) != 0});
    }
    libusb_free_pollfds(all);
  }

 private:
  enum class State : std::uint8_t { kIdle, kQueued, kDone, kLent };
  struct Slot {
    UsbSource* source = nullptr;
    std::size_t index = 0;
    std::unique_ptr<std::uint8_t[]> memory;
    std::unique_ptr<libusb_transfer, Closer> transfer;
    State state = State::kIdle;
    std::size_t bytes = 0;
    Instant at;
    bool damaged = false, starved = false;
  };

  int submit(Slot& slot) {
    slot.starved = starved_;
    const int error = errno_of(libusb_submit_transfer(slot.transfer.get()));
    if (error != 0) return error;
    slot.state = State::kQueued;
    starved_ = false;
    return 0;
  }

  std::size_t queued() const {
    return static_cast<std::size_t>(
        std::count_if(slots_.begin(), slots_.end(), [](const Slot& slot) { return slot.state == State::kQueued; }));
  }

  static void LIBUSB_CALL done(libusb_transfer* transfer) {
    Slot& slot = *static_cast<Slot*>(transfer->user_data);
    slot.source->complete(slot);
  }

  void complete(Slot& slot) {
    slot.at = clock_.now();
    slot.bytes = static_cast<std::size_t>(std::max(slot.transfer->actual_length, 0));
    slot.damaged = slot.transfer->status == LIBUSB_TRANSFER_OVERFLOW;
    switch (slot.transfer->status) {
      case LIBUSB_TRANSFER_COMPLETED:
      case LIBUSB_TRANSFER_OVERFLOW:
        slot.state = State::kDone;
        done_.push_back(slot.index);
        return;
      case LIBUSB_TRANSFER_CANCELLED: slot.state = State::kIdle; return;
      case LIBUSB_TRANSFER_NO_DEVICE: broken_ = ENODEV; break;
      default:
        if (broken_ == 0) broken_ = EIO;
        break;
    }
    slot.state = State::kIdle;
  }

  void handle_events(int at_most_ms) {
    timeval at_most{0, at_most_ms * 1000};
    libusb_handle_events_timeout_completed(context_.get(), &at_most, nullptr);
  }

  void drain() {
    std::vector<std::uint8_t> rest(frame_bytes_);
    for (int i = 0; i < kMaxDrains; ++i) {
      int bytes = 0;
      const int error =
          libusb_bulk_transfer(handle_.get(), kEndpoint, rest.data(), static_cast<int>(rest.size()), &bytes, kDrainMs);
      if (error != 0 && bytes == 0) return;
    }
  }

  linux_os::LinuxClock clock_;
  UsbContext context_;
  UsbHandle handle_;
  int interface_ = -1;
  std::vector<Slot> slots_;  // after the handle: their transfers are freed before it is closed
  const std::size_t frame_bytes_;
  std::deque<std::size_t> done_;
  int broken_ = 0;        ///< an errno
  bool starved_ = false;  ///< nothing was queued since the last submission
};

}  // namespace

int make_usb_source(int bus, int address, std::size_t buffers, std::size_t frame_bytes,
                    std::unique_ptr<FrameSource>& source) {
  auto made = std::make_unique<UsbSource>(buffers, frame_bytes);
  if (const int error = made->open(bus, address); error != 0) return error;
  source = std::move(made);
  return 0;
}

}  // namespace nodal::hal::iidc
