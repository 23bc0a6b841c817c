#include "hal/linux/confine/confined_process.h"

#include <fmt/format.h>

#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <limits>
#include <new>
#include <span>
#include <utility>

#include "hal/linux/confine/own_descriptor.h"

namespace nodal::hal::linux_os {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// A message on the socket between the process and its helper, with at most one descriptor.
struct Message {
  enum class Kind : std::uint32_t { kJob, kEnd, kEnded };
  Kind kind = Kind::kEnd;
  std::int32_t status = 0;  ///< the worker's status as waitpid() gives it, for kEnded
  std::uint32_t name = 0;   ///< bytes of ConfinedJob::what, in front in the memory
  std::uint32_t reserved = 0;
  std::uint64_t input = 0;  ///< bytes of ConfinedJob::input, behind it
};

/// In front of a result, in the memory that the worker fills.
struct ResultHead {
  std::uint32_t complete = 0;  ///< kComplete: all of it is there
  std::uint32_t code = 0;      ///< code of the error, whose sentence follows; 0: the result follows
  std::uint64_t bytes = 0;
};
constexpr std::uint32_t kComplete = 0x4c4c4146;
constexpr std::size_t kLongestError = 4096;
constexpr int kOutOfMemory = 77, kException = 78;  // exit statuses of a worker
constexpr int kNice = 10;                          // the frame path has priority
constexpr int kSocket = 3;                         // descriptor of the helper's socket

bool send(int socket, Message message, int descriptor = -1) {
  iovec part{&message, sizeof message};
  msghdr about{};
  about.msg_iov = &part;
  about.msg_iovlen = 1;
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> space{};
  if (descriptor >= 0) {
    about.msg_control = space.data();
    about.msg_controllen = space.size();
    cmsghdr* const head = CMSG_FIRSTHDR(&about);
    head->cmsg_level = SOL_SOCKET;
    head->cmsg_type = SCM_RIGHTS;
    head->cmsg_len = CMSG_LEN(sizeof(int));
    std::memcpy(CMSG_DATA(head), &descriptor, sizeof descriptor);
  }
  ssize_t sent = -1;
  do sent = ::sendmsg(socket, &about, MSG_NOSIGNAL);
  while (sent < 0 && errno == EINTR);
  return sent == static_cast<ssize_t>(sizeof message);
}

enum class Received : std::uint8_t { kMessage, kNothing, kClosed };

Received receive(int socket, int flags, Message& message, int& descriptor) {
  iovec part{&message, sizeof message};
  msghdr about{};
  about.msg_iov = &part;
  about.msg_iovlen = 1;
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> space{};
  about.msg_control = space.data();
  about.msg_controllen = space.size();
  descriptor = -1;
  ssize_t got = -1;
  do got = ::recvmsg(socket, &about, flags | MSG_CMSG_CLOEXEC);
  while (got < 0 && errno == EINTR);
  if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return Received::kNothing;
  if (got != static_cast<ssize_t>(sizeof message)) return Received::kClosed;
  const cmsghdr* const head = CMSG_FIRSTHDR(&about);
  if (head != nullptr && head->cmsg_type == SCM_RIGHTS) std::memcpy(&descriptor, CMSG_DATA(head), sizeof descriptor);
  return Received::kMessage;
}

/// pread() or pwrite() until all bytes are read or written.
template <class Call, class Byte>
bool all_at(Call call, int fd, std::uint64_t at, std::span<Byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t done = call(fd, bytes.data(), bytes.size(), static_cast<off_t>(at));
    if (done <= 0) return false;
    at += static_cast<std::uint64_t>(done);
    bytes = bytes.subspan(static_cast<std::size_t>(done));
  }
  return true;
}
bool write_at(int fd, std::uint64_t at, std::span<const std::uint8_t> bytes) { return all_at(::pwrite, fd, at, bytes); }
bool read_at(int fd, std::uint64_t at, std::span<std::uint8_t> bytes) { return all_at(::pread, fd, at, bytes); }

template <class T>
std::span<const std::uint8_t> bytes_of(const T& value) {
  return {reinterpret_cast<const std::uint8_t*>(&value), sizeof value};
}
std::span<const std::uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

/// Memory of a fixed size, which two processes share by its descriptor.
int make_memory(std::uint64_t bytes) {
  const int fd = ::memfd_create("nodal-confined", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  if (fd < 0) return -1;
  if (::ftruncate(fd, static_cast<off_t>(bytes)) == 0 && ::fcntl(fd, F_ADD_SEALS, F_SEAL_GROW | F_SEAL_SHRINK) == 0)
    return fd;
  ::close(fd);
  return -1;
}

void limit(int resource, std::uint64_t value) {
  const rlimit both{value, value};
  if (value != 0) (void)::setrlimit(static_cast<__rlimit_resource_t>(resource), &both);
}

/// Addresses that this process uses already.
std::uint64_t addresses() {
  std::array<char, 64> text{};
  const OwnDescriptor file(::open("/proc/self/statm", O_RDONLY | O_CLOEXEC));
  if (!file || ::read(file.get(), text.data(), text.size() - 1) <= 0) return 0;
  return std::strtoull(text.data(), nullptr, 10) * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

/// The kernel ends this process before others when the system has no more memory.
void be_ended_first() {
  const OwnDescriptor file(::open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC));
  if (file) (void)!::write(file.get(), "1000", 4);
}

void store(int memory, const Result<Bytes>& result, std::size_t most) {
  ResultHead head{kComplete, 0, 0};
  std::span<const std::uint8_t> bytes;
  if (result && result->size() <= most) {
    bytes = *result;
  } else {
    const Error error = result ? Error{Errc::kTooLarge, "the result is too large"} : result.error();
    static thread_local std::string text;
    text = error.message.substr(0, kLongestError);
    bytes = bytes_of(text);
    head.code = static_cast<std::uint32_t>(error.code);
  }
  head.bytes = bytes.size();
  if (!write_at(memory, sizeof head, bytes) || !write_at(memory, 0, bytes_of(head))) ::_exit(kException);
}

/// The worker's whole life.
[[noreturn]] void do_job(const ConfinedLimits& limits, const ConfinedWork& work, const Message& message, int input,
                         int output, std::atomic<std::uint64_t>& progress) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  ::prctl(PR_SET_NAME, "nodal-confined");
  ::prctl(PR_SET_DUMPABLE, 0);
  be_ended_first();
  (void)::setpriority(PRIO_PROCESS, 0, kNice);
  limit(RLIMIT_AS, limits.memory_bytes == 0 ? 0 : addresses() + limits.memory_bytes);
  limit(RLIMIT_CPU, limits.cpu_seconds);
  limit(RLIMIT_CORE, 1);
  try {
    ConfinedJob job;
    job.what.resize(message.name);
    job.input.resize(message.input);
    const std::span name(reinterpret_cast<std::uint8_t*>(job.what.data()), job.what.size());
    if (!read_at(input, 0, name) || !read_at(input, message.name, job.input)) ::_exit(kException);
    ::close(input);
    store(output, work(job, [&progress] { progress.fetch_add(1, std::memory_order_relaxed); }), limits.result_bytes);
  } catch (const std::bad_alloc&) {
    ::_exit(kOutOfMemory);
  } catch (const std::exception&) {
    ::_exit(kException);
  }
  ::_exit(0);
}

/// Waits for the worker; ends it when the process asks for that, or is gone. Returns waitpid()'s status.
int wait_for(pid_t worker) {
  const OwnDescriptor ended(::syscall(SYS_pidfd_open, worker, 0));
  for (;;) {
    std::array<pollfd, 2> wait{pollfd{ended.get(), POLLIN, 0}, pollfd{kSocket, POLLIN, 0}};
    if (::poll(wait.data(), wait.size(), -1) < 0 && errno != EINTR) break;
    if (wait[0].revents != 0) break;
    if (wait[1].revents == 0) continue;
    Message message;
    int descriptor = -1;
    const Received received = receive(kSocket, 0, message, descriptor);
    if (descriptor >= 0) ::close(descriptor);
    ::kill(worker, SIGKILL);
    if (received == Received::kClosed) ::_exit(0);
    break;
  }
  int status = 0;
  while (::waitpid(worker, &status, 0) < 0 && errno == EINTR) {}
  return status;
}

/// The helper's whole life.
[[noreturn]] void help(const ConfinedLimits& limits, const ConfinedWork& work, std::atomic<std::uint64_t>& progress) {
  for (;;) {
    Message message;
    int descriptor = -1;
    if (receive(kSocket, 0, message, descriptor) == Received::kClosed) ::_exit(0);
    if (message.kind != Message::Kind::kJob || descriptor < 0) continue;  // an end for a job that had just ended
    const OwnDescriptor input(descriptor);
    const OwnDescriptor output(make_memory(sizeof(ResultHead) + std::max(limits.result_bytes, kLongestError)));
    int status = kOutOfMemory << 8;
    if (output) {
      const pid_t worker = ::fork();
      if (worker == 0) do_job(limits, work, message, input.get(), output.get(), progress);
      if (worker > 0) status = wait_for(worker);
    }
    if (!send(kSocket, {Message::Kind::kEnded, status}, output.get())) ::_exit(0);
  }
}

/// From fork() to help(): the helper has its socket, standard error, and nothing else of the process.
[[noreturn]] void become_helper(int socket, const ConfinedLimits& limits, const ConfinedWork& work,
                                std::atomic<std::uint64_t>& progress) {
  // The process's handlers are not for its helper: SIGXCPU must end a worker. Only SIGPIPE stays as it is.
  for (int signal = 1; signal < SIGRTMIN; ++signal) {
    if (signal != SIGPIPE) ::signal(signal, SIG_DFL);
  }
  // Signals for the process group are for the process, which then ends the helper.
  sigset_t of_group;
  sigemptyset(&of_group);
  for (const int signal : {SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGTSTP}) sigaddset(&of_group, signal);
  ::sigprocmask(SIG_SETMASK, &of_group, nullptr);
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  ::prctl(PR_SET_NAME, "nodal-helper");
  if (::dup3(socket, kSocket, O_CLOEXEC) < 0 && socket != kSocket) ::_exit(kException);
  ::syscall(SYS_close_range, kSocket + 1, std::numeric_limits<unsigned>::max(), 0);
  help(limits, work, progress);
}

}  // namespace

Result<std::unique_ptr<ConfinedProcess>> ConfinedProcess::start(const ConfinedLimits& limits, ConfinedWork work) {
  const auto refused = [] {
    return fail(Errc::kOverload, std::string("no process for reading foreign data: ") + std::strerror(errno));
  };
  void* const page = ::mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (page == MAP_FAILED) return refused();
  Shared* const shared = new (page) Shared(0);
  std::array<int, 2> ends{-1, -1};
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    ::munmap(page, sizeof(Shared));
    return refused();
  }
  const pid_t helper = ::fork();
  if (helper == 0) become_helper(ends[1], limits, work, *shared);
  ::close(ends[1]);
  std::unique_ptr<ConfinedProcess> made(new ConfinedProcess(limits, ends[0], shared));
  if (helper < 0) return refused();
  return made;
}

ConfinedProcess::~ConfinedProcess() {
  ::close(helper_);  // the helper ends its worker, then itself
  ::munmap(shared_, sizeof(Shared));
}

Status ConfinedProcess::begin(ConfinedJob job) {
  if (state_ == State::kEnding) (void)take_result();
  if (gone_) return fail(Errc::kDeviceGone, "the process for reading foreign data is gone; restart nodald");
  if (state_ != State::kIdle) return fail(Errc::kBusy, "foreign data is being read; try again in a moment");
  const OwnDescriptor memory(make_memory(job.what.size() + job.input.size()));
  if (!memory || !write_at(memory.get(), 0, bytes_of(job.what)) ||
      !write_at(memory.get(), job.what.size(), job.input)) {
    return fail(Errc::kOverload, std::string("no memory for reading foreign data: ") + std::strerror(errno));
  }
  shared_->store(0, std::memory_order_relaxed);
  const Message message{Message::Kind::kJob, 0, static_cast<std::uint32_t>(job.what.size()), 0, job.input.size()};
  if (!send(helper_, message, memory.get())) {
    gone_ = true;
    return fail(Errc::kDeviceGone, "the process for reading foreign data is gone; restart nodald");
  }
  state_ = State::kRunning;
  hung_ = false;
  last_progress_ = 0;
  progressed_ = std::chrono::steady_clock::now();
  return {};
}

std::optional<Result<std::vector<std::uint8_t>>> ConfinedProcess::take_result() {
  if (state_ == State::kIdle) return std::nullopt;
  Message message;
  int descriptor = -1;
  const Received received = receive(helper_, MSG_DONTWAIT, message, descriptor);
  if (received == Received::kNothing) {
    watch();
    return std::nullopt;
  }
  const OwnDescriptor memory(descriptor);
  const bool wanted = std::exchange(state_, State::kIdle) == State::kRunning;
  if (received == Received::kClosed) {
    gone_ = true;
    if (!wanted) return std::nullopt;
    return fail(Errc::kDeviceGone, "the process for reading foreign data is gone; restart nodald");
  }
  if (!wanted) return std::nullopt;
  return result_of(message.status, memory.get());
}

/// Ends a job that counts no progress.
void ConfinedProcess::watch() {
  const auto now = std::chrono::steady_clock::now();
  if (const std::uint64_t progress = this->progress(); std::exchange(last_progress_, progress) != progress)
    progressed_ = now;
  if (hung_ || state_ != State::kRunning || now - progressed_ < limits_.without_progress) return;
  hung_ = true;
  (void)send(helper_, {Message::Kind::kEnd});
}

Result<std::vector<std::uint8_t>> ConfinedProcess::result_of(int status, int memory) const {
  constexpr std::uint64_t kMiB = 1 << 20;
  if (WIFEXITED(status) && WEXITSTATUS(status) == kOutOfMemory) {
    return fail(Errc::kOverload, fmt::format("needs more than {} MiB of memory", limits_.memory_bytes / kMiB));
  }
  if (WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    if (hung_) {
      return fail(Errc::kOverload, fmt::format("made no progress for {} s", limits_.without_progress.count()));
    }
    if (signal == SIGXCPU || signal == SIGKILL) {
      return fail(
          Errc::kOverload,
          fmt::format(
              "was ended by the system: it needs more than {} s of processor time, or more memory than there is",
              limits_.cpu_seconds));
    }
    return fail(Errc::kInternal, fmt::format("crashed (signal {})", signal));
  }
  ResultHead head;
  const std::span raw(reinterpret_cast<std::uint8_t*>(&head), sizeof head);
  const std::size_t most = std::max(limits_.result_bytes, kLongestError);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0 || !read_at(memory, 0, raw) || head.complete != kComplete ||
      head.bytes > most) {
    return fail(Errc::kInternal, "ended without a result");
  }
  Bytes bytes(static_cast<std::size_t>(head.bytes));
  if (!read_at(memory, sizeof head, bytes)) return fail(Errc::kInternal, "ended without a result");
  if (head.code == 0) return bytes;
  if (head.code > std::numeric_limits<std::uint16_t>::max()) return fail(Errc::kInternal, "ended without a result");
  return fail(static_cast<Errc>(head.code), std::string(bytes.begin(), bytes.end()));
}

void ConfinedProcess::end() {
  if (state_ != State::kRunning) return;
  state_ = State::kEnding;
  (void)send(helper_, {Message::Kind::kEnd});
}

}  // namespace nodal::hal::linux_os
