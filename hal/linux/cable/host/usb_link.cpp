#include <fmt/format.h>

#include <sys/epoll.h>
#include <sys/time.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <optional>
#include <utility>

#include "hal/linux/cable/host/device.h"
#include "hal/linux/cable/receive_ring.h"
#include "hal/linux/cable/records.h"
#include "hal/linux/link/descriptor_link.h"
#include "protocol/base/try.h"

namespace nodal::hal::cable {
namespace {

constexpr unsigned kOpenTimeoutMs = 3000;
constexpr auto kFarewell = std::chrono::milliseconds(1000);
constexpr auto kCancelled = std::chrono::milliseconds(1000);

std::string reason(libusb_transfer_status status) {
  switch (status) {
    case LIBUSB_TRANSFER_NO_DEVICE: return "the cable was unplugged, or nodald ended";
    case LIBUSB_TRANSFER_STALL: return "the rig refuses USB transfers";
    default: return "a USB transfer failed; the cable was unplugged, or nodald ended";
  }
}

class UsbLink final : public LinkPort {
 public:
  UsbLink(OpenDevice device, std::uint16_t session)
      : device_(std::move(device)),
        session_(session),
        received_([this](std::size_t slot) { return submit(from_rig_[slot]); }) {}

  ~UsbLink() override {
    const auto until = std::chrono::steady_clock::now() + kFarewell;
    bool end_queued = false;
    while (!why_ && !received_.ended() && (!end_queued || writes_queued_ > 0) &&
           std::chrono::steady_clock::now() < until) {
      // The last record; without a payload it is queued as soon as a slot is free.
      if (!end_queued) end_queued = queue_record({}).has_value();
      handle_events(10);
    }
    cancel();
    if (device_.handle) libusb_release_interface(device_.handle.get(), device_.interface);
  }
  UsbLink(const UsbLink&) = delete;
  UsbLink& operator=(const UsbLink&) = delete;

  Status open() {
    for (auto* slots : {&from_rig_, &to_rig_}) {
      for (std::size_t i = 0; i < kTransfers; ++i) {
        Slot& slot = (*slots)[i];
        slot.transfer = libusb_alloc_transfer(0);
        if (slot.transfer == nullptr) return fail(Errc::kIo, device_.text + ": no memory for USB transfers");
        slot.link = this;
        slot.index = i;
        slot.receives = slots == &from_rig_;
        libusb_fill_bulk_transfer(slot.transfer, device_.handle.get(),
                                  slot.receives ? device_.from_rig : device_.to_rig, slot.buffer.data(),
                                  static_cast<int>(kTransferBytes), done, &slot, 0);
      }
    }
    NODAL_TRY(make_pollable());
    received_.begin(session_);
    if (why_) return fail(Errc::kUnreachable, device_.text + ": " + *why_);
    return {};
  }

  Result<std::size_t> read(std::span<std::uint8_t> into) override {
    if (into.empty()) return 0;
    handle_events(0);
    std::size_t n = 0;
    while (n < into.size()) {
      const auto part = received_.next_bytes(into.size() - n);
      if (part.empty()) break;
      std::memcpy(into.data() + n, part.data(), part.size());
      n += part.size();
    }
    if (n == 0 && over()) return closed();
    return n;
  }

  Result<std::size_t> write(std::span<const std::uint8_t> from) override {
    if (from.empty()) return 0;
    handle_events(0);
    received_.advance();
    if (over()) return closed();
    std::size_t n = 0;
    while (n < from.size()) {
      const auto taken = queue_record(from.subspan(n));
      if (!taken) break;
      n += *taken;
    }
    return n;
  }

  const std::string& peer() const override { return device_.text; }
  std::optional<PeerIdentity> identity() const override { return std::nullopt; }
  void add_wake_ups(WakeUps& to, bool to_read, bool to_write) const override {
    if ((to_read && (over() || received_.ready())) || (to_write && (over() || writes_queued_ < kTransfers))) {
      to.at(Instant());
    }
    to.on({poll_.get(), to_read || to_write, false});
  }

 private:
  struct Slot {
    libusb_transfer* transfer = nullptr;
    UsbLink* link = nullptr;
    std::size_t index = 0;
    bool receives = false;
    bool queued = false;
    std::array<std::uint8_t, kTransferBytes> buffer;
    Slot() = default;
    ~Slot() {
      if (transfer != nullptr) libusb_free_transfer(transfer);
    }
    Slot(const Slot&) = delete;
    Slot& operator=(const Slot&) = delete;
  };
  using Slots = std::array<Slot, kTransfers>;

  bool over() const { return why_ || received_.violation() || received_.ended(); }

  static void LIBUSB_CALL done(libusb_transfer* transfer) {
    Slot& slot = *static_cast<Slot*>(transfer->user_data);
    slot.link->complete(slot);
  }

  void complete(Slot& slot) {
    slot.queued = false;
    const libusb_transfer_status status = slot.transfer->status;
    if (slot.receives) {
      // What arrived before a failure counts, too.
      const auto bytes = static_cast<std::size_t>(std::max(slot.transfer->actual_length, 0));
      received_.received(slot.index, std::span<const std::uint8_t>(slot.buffer).first(bytes));
    } else {
      --writes_queued_;
    }
    if (status != LIBUSB_TRANSFER_COMPLETED) end(reason(status));
  }

  void end(const std::string& why) {
    if (!why_) why_ = why;
    received_.stop();
  }

  bool submit(Slot& slot) {
    const int error = libusb_submit_transfer(slot.transfer);
    if (error != 0) end(error == LIBUSB_ERROR_NO_DEVICE ? reason(LIBUSB_TRANSFER_NO_DEVICE) : libusb_strerror(error));
    slot.queued = error == 0;
    return slot.queued;
  }

  /// Queues one record; returns the payload it took, nothing if all slots are in use.
  std::optional<std::size_t> queue_record(std::span<const std::uint8_t> payload) {
    const auto free = std::find_if(to_rig_.begin(), to_rig_.end(), [](const Slot& slot) { return !slot.queued; });
    if (free == to_rig_.end()) return std::nullopt;
    const WrittenRecord record = write_record(session_, payload, free->buffer);
    free->transfer->length = static_cast<int>(record.transfer);
    if (!submit(*free)) return std::nullopt;
    ++writes_queued_;
    return record.payload;
  }

  void handle_events(int at_most_ms) {
    timeval at_most{0, at_most_ms * 1000};
    libusb_handle_events_timeout_completed(device_.context.get(), &at_most, nullptr);
  }

  void cancel() {
    for (Slots* slots : {&from_rig_, &to_rig_}) {
      for (Slot& slot : *slots) {
        if (slot.queued) libusb_cancel_transfer(slot.transfer);
      }
    }
    received_.stop();
    const auto until = std::chrono::steady_clock::now() + kCancelled;
    while (received_.queued() + writes_queued_ > 0) {
      handle_events(10);
      // The kernel ends transfers at once. One that it keeps would be freed while it is written.
      NODAL_ASSERT(std::chrono::steady_clock::now() < until);
    }
  }

  Status make_pollable() {
    poll_ = Descriptor(::epoll_create1(EPOLL_CLOEXEC));
    if (poll_.get() < 0) return system_error(Errc::kIo, device_.text, errno);
    const libusb_pollfd** all = libusb_get_pollfds(device_.context.get());
    if (all == nullptr) return fail(Errc::kIo, device_.text + ": libusb has no file descriptors to wait for");
    Status added;
    for (const libusb_pollfd** one = all; *one != nullptr; ++one) {
      epoll_event event{};
      event.events = static_cast<std::uint32_t>((*one)->events);  // POLLIN and POLLOUT are EPOLLIN and EPOLLOUT
      if (::epoll_ctl(poll_.get(), EPOLL_CTL_ADD, (*one)->fd, &event) != 0) {
        added = system_error(Errc::kIo, device_.text, errno);
      }
    }
    libusb_free_pollfds(all);
    return added;
  }

  tl::unexpected<Error> closed() const {
    if (received_.violation()) return fail(received_.violation()->in(device_.text));
    return fail(Errc::kLinkClosed, device_.text + ": " + (why_ ? *why_ : "the rig closed the link"));
  }

  OpenDevice device_;
  std::uint16_t session_;
  Descriptor poll_;
  std::optional<std::string> why_;
  Slots from_rig_;
  Slots to_rig_;
  ReceiveRing received_;
  std::size_t writes_queued_ = 0;
};

}  // namespace

Result<std::unique_ptr<LinkPort>> connect_cable(std::string_view serial) {
  NODAL_TRY_ASSIGN(auto device, open_device(serial));
  // Both ends count packets modulo 2; a host that was killed may have left them out of step.
  libusb_clear_halt(device.handle.get(), device.to_rig);
  libusb_clear_halt(device.handle.get(), device.from_rig);
  std::array<std::uint8_t, kAnswerBytes> bytes{};
  const int n = libusb_control_transfer(device.handle.get(), kOpenRequestType, kOpenRequest, kVersion,
                                        static_cast<std::uint16_t>(device.interface), bytes.data(),
                                        static_cast<std::uint16_t>(bytes.size()), kOpenTimeoutMs);
  if (n < 0) {
    const std::string why = n == LIBUSB_ERROR_TIMEOUT ? "nodald did not answer within 3 s" : libusb_strerror(n);
    return fail(Errc::kUnreachable, device.text + ": " + why);
  }
  const auto answer = read_answer(std::span(bytes).first(static_cast<std::size_t>(n)));
  if (!answer) return fail(Errc::kUnreachable, device.text + ": this USB device is not a rig");
  if (answer->version != kVersion) {
    return fail(Errc::kVersionMismatch,
                fmt::format("{}: the rig's version of the cable is {}, this program's {}; update the older one",
                            device.text, answer->version, kVersion));
  }
  auto link = std::make_unique<UsbLink>(std::move(device), answer->session);
  NODAL_TRY(link->open());
  return link;
}

}  // namespace nodal::hal::cable
