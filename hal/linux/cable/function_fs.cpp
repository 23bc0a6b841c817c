#include "hal/linux/cable/function_fs.h"

#include <endian.h>
#include <fcntl.h>
#include <linux/aio_abi.h>
#include <linux/usb/functionfs.h>
#include <poll.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/file.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <utility>

#include "hal/linux/cable/answer_thread.h"
#include "hal/linux/link/descriptor_link.h"
#include "protocol/base/try.h"

namespace nodal::hal::cable {
namespace {

constexpr std::size_t kSlots = 2 * kTransfers;

FunctionEvent translate(const usb_functionfs_event& event) {
  using Kind = FunctionEvent::Kind;
  switch (event.type) {
    case FUNCTIONFS_ENABLE: return {Kind::kEnabled, {}};
    case FUNCTIONFS_DISABLE:
    case FUNCTIONFS_UNBIND: return {Kind::kDisabled, {}};
    case FUNCTIONFS_SETUP: {
      const usb_ctrlrequest& setup = event.u.setup;
      return {
          Kind::kSetup,
          {setup.bRequestType, setup.bRequest, le16toh(setup.wValue), le16toh(setup.wIndex), le16toh(setup.wLength)}};
    }
    default: return {};  // FUNCTIONFS_BIND, _SUSPEND, _RESUME
  }
}

/// Data endpoints cannot be polled; asynchronous I/O with an eventfd can. (glibc has no wrappers for these calls.)
class FunctionFs final : public UsbFunction {
 public:
  FunctionFs(std::string folder, std::shared_ptr<const int> ep0)
      : folder_(std::move(folder)), ep0_(std::move(ep0)), answers_(ep0_) {}

  ~FunctionFs() override {
    // Cancels the transfers and returns when they have ended, so that the kernel no longer uses the buffers.
    if (context_ != 0) ::syscall(SYS_io_destroy, context_);
  }
  FunctionFs(const FunctionFs&) = delete;
  FunctionFs& operator=(const FunctionFs&) = delete;

  Status open() {
    const auto endpoint = [&](const char* name, Descriptor& file) -> Status {
      file = Descriptor(::open((folder_ + name).c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
      if (file.get() < 0) return system_error(Errc::kIo, folder_ + name, errno);
      return {};
    };
    NODAL_TRY(endpoint("/ep1", from_host_));
    NODAL_TRY(endpoint("/ep2", to_host_));
    done_ = Descriptor(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC));
    either_ = Descriptor(::epoll_create1(EPOLL_CLOEXEC));
    if (done_.get() < 0 || either_.get() < 0) return system_error(Errc::kIo, folder_, errno);
    for (const int fd : {*ep0_, done_.get()}) {
      epoll_event event{};
      event.events = EPOLLIN;
      if (::epoll_ctl(either_.get(), EPOLL_CTL_ADD, fd, &event) != 0) return system_error(Errc::kIo, folder_, errno);
    }
    if (::syscall(SYS_io_setup, kSlots, &context_) != 0) {
      return system_error(Errc::kIo, folder_ + ": asynchronous I/O (sysctl fs.aio-max-nr)", errno);
    }
    return {};
  }

  Result<std::optional<FunctionEvent>> next_event() override {
    if (asked_ || answers_.busy()) return std::nullopt;
    usb_functionfs_event raw{};
    const ssize_t n = ::read(*ep0_, &raw, sizeof(raw));
    if (n == sizeof(raw)) {
      const FunctionEvent event = translate(raw);
      asked_ = event.kind == FunctionEvent::Kind::kSetup;
      return event;
    }
    // EIDRM: a request that was replaced by a later one. EAGAIN: no event.
    if (n < 0 && (errno == EAGAIN || errno == EINTR || errno == EIDRM)) return std::nullopt;
    return system_error(Errc::kIo, folder_ + "/ep0: the gadget is gone; restart nodald", n < 0 ? errno : EIO);
  }

  void answer(std::span<const std::uint8_t> bytes) override {
    asked_ = false;
    answers_.write(bytes);
  }

  // FunctionFS stalls a request that is answered in the wrong direction; it does not wait then.
  void refuse(const Setup& setup) override {
    asked_ = false;
    std::uint8_t byte = 0;
    const bool to_host = (setup.type & USB_DIR_IN) != 0;
    [[maybe_unused]] const ssize_t stalled = to_host ? ::read(*ep0_, &byte, 0) : ::write(*ep0_, &byte, 0);
  }

  std::span<std::uint8_t, kTransferBytes> buffer(Direction direction, std::size_t slot) override {
    return buffers_[index(direction, slot)];
  }
  bool queue_read(std::size_t slot) override { return queue(Direction::kFromHost, slot, kTransferBytes); }
  bool queue_write(std::size_t slot, std::size_t bytes) override { return queue(Direction::kToHost, slot, bytes); }

  void cancel_all() override {
    io_event unused{};
    for (std::size_t i = 0; i < kSlots; ++i) {
      if (queued_[i]) ::syscall(SYS_io_cancel, context_, &transfers_[i], &unused);
    }
  }

  std::optional<Completion> next_completion() override {
    if (next_ == completed_) {
      std::uint64_t rung = 0;
      if (::read(done_.get(), &rung, sizeof(rung)) != sizeof(rung)) return std::nullopt;
      timespec at_once{};
      const auto n = ::syscall(SYS_io_getevents, context_, 0, kSlots, completions_.data(), &at_once);
      next_ = 0;
      completed_ = n > 0 ? static_cast<std::size_t>(n) : 0;
      if (completed_ == 0) return std::nullopt;
    }
    const io_event& event = completions_[next_++];
    const auto i = static_cast<std::size_t>(event.data);
    queued_[i] = false;
    return Completion{i < kTransfers ? Direction::kFromHost : Direction::kToHost, i % kTransfers, event.res};
  }

  int descriptor() const override { return either_.get(); }

  void wait(Duration at_most) override {
    pollfd either{either_.get(), POLLIN, 0};
    ::poll(&either, 1, static_cast<int>(at_most.ms()));
  }

 private:
  static std::size_t index(Direction direction, std::size_t slot) {
    return slot + (direction == Direction::kToHost ? kTransfers : 0);
  }

  bool queue(Direction direction, std::size_t slot, std::size_t bytes) {
    const std::size_t i = index(direction, slot);
    iocb& transfer = transfers_[i];
    transfer = {};
    transfer.aio_data = i;
    transfer.aio_lio_opcode = direction == Direction::kToHost ? IOCB_CMD_PWRITE : IOCB_CMD_PREAD;
    transfer.aio_fildes =
        static_cast<std::uint32_t>(direction == Direction::kToHost ? to_host_.get() : from_host_.get());
    transfer.aio_buf = reinterpret_cast<std::uintptr_t>(buffers_[i].data());
    transfer.aio_nbytes = bytes;
    transfer.aio_flags = IOCB_FLAG_RESFD;
    transfer.aio_resfd = static_cast<std::uint32_t>(done_.get());
    iocb* one = &transfer;
    queued_[i] = ::syscall(SYS_io_submit, context_, 1, &one) == 1;
    return queued_[i];
  }

  std::string folder_;
  std::shared_ptr<const int> ep0_;
  AnswerThread answers_;
  bool asked_ = false;  ///< a request is to be answered; until then, reading ep0 for events would refuse it
  Descriptor from_host_, to_host_, done_, either_;
  aio_context_t context_ = 0;
  std::array<std::array<std::uint8_t, kTransferBytes>, kSlots> buffers_{};
  std::array<iocb, kSlots> transfers_{};
  std::array<bool, kSlots> queued_{};
  std::array<io_event, kSlots> completions_{};
  std::size_t next_ = 0;
  std::size_t completed_ = 0;
};

std::shared_ptr<const int> shared_descriptor(int fd) {
  return {new int(fd), [](const int* it) {
            ::close(*it);
            delete it;
          }};
}

}  // namespace

Result<std::unique_ptr<UsbFunction>> open_function(const std::string& folder, const std::string& rig) {
  const std::string path = folder + "/ep0";
  const int fd = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0 && errno == ENOENT) {
    return fail(Errc::kNotFound,
                path + ": no USB gadget is set up there; `systemctl enable --now nodal-cable` does it");
  }
  if (fd < 0) return system_error(Errc::kIo, path, errno);
  const auto ep0 = shared_descriptor(fd);
  // The kernel takes what a second program writes for an answer to a host.
  if (::flock(fd, LOCK_EX | LOCK_NB) != 0) {
    return fail(Errc::kBusy, path + ": another program serves the cable already; is another nodald running?");
  }
  for (const auto& bytes : {function_descriptors(), function_strings(rig)}) {
    if (::write(fd, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size())) continue;
    return system_error(Errc::kIo, path + ": writing the USB descriptors", errno);
  }
  auto function = std::make_unique<FunctionFs>(folder, ep0);
  NODAL_TRY(function->open());
  return function;
}

}  // namespace nodal::hal::cable
