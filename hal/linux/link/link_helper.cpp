#include "hal/linux/link/link_helper.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "hal/linux/link/wait.h"

namespace nodal::hal {
namespace {

constexpr std::size_t kMaxMessage = 4096;  // bytes of an error's number and sentence
constexpr Duration kLookEvery = Duration::seconds(1);
// How long the last bytes of a process that closed its link may take.
constexpr Duration kFarewell = Duration::seconds(1);

/// Two connected Unix sockets.
struct Pair {
  Descriptor near, far;
};
std::optional<Pair> make_pair_of(int kind) {
  std::array<int, 2> ends{-1, -1};
  if (::socketpair(AF_UNIX, kind | SOCK_CLOEXEC, 0, ends.data()) != 0) return std::nullopt;
  return Pair{Descriptor(ends[0]), Descriptor(ends[1])};
}

/// An error as a message between the processes: its number in two bytes, then the sentence. Number 0: the link is
/// there, and its peer's name follows.
void send_error(int socket, const Error& error) {
  const auto code = static_cast<std::uint16_t>(error.code);
  std::string message{static_cast<char>(code & 0xff), static_cast<char>(code >> 8)};
  message += error.message.substr(0, kMaxMessage - message.size());
  (void)!::send(socket, message.data(), message.size(), MSG_NOSIGNAL);
}
void send_success(int socket, const std::string& peer) { send_error(socket, Error{static_cast<Errc>(0), peer}); }

/// Waits for a message; nothing if the other process is gone.
std::optional<Error> receive_error(int socket, int flags) {
  std::array<char, kMaxMessage> message{};
  ssize_t got = -1;
  do {
    got = ::recv(socket, message.data(), message.size(), flags);
  } while (got < 0 && errno == EINTR);
  if (got < 2) return std::nullopt;
  const auto byte = [&](std::size_t at) { return static_cast<unsigned>(static_cast<unsigned char>(message[at])); };
  return Error{static_cast<Errc>(byte(0) | byte(1) << 8), std::string(message.data() + 2, message.data() + got)};
}

/// A message of one byte and the two descriptors of a link: its bytes, and its messages.
struct DescriptorMessage {
  using Both = std::array<int, 2>;
  DescriptorMessage() {
    header.msg_iov = &part;
    header.msg_iovlen = 1;
    header.msg_control = space.data();
    header.msg_controllen = space.size();
  }
  DescriptorMessage(const DescriptorMessage&) = delete;
  DescriptorMessage& operator=(const DescriptorMessage&) = delete;

  char nothing = 0;
  iovec part{&nothing, 1};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(Both))> space{};
  msghdr header{};
};

bool send_descriptors(int socket, int bytes, int messages) {
  const DescriptorMessage::Both both{bytes, messages};
  DescriptorMessage message;
  cmsghdr* const head = CMSG_FIRSTHDR(&message.header);
  head->cmsg_level = SOL_SOCKET;
  head->cmsg_type = SCM_RIGHTS;
  head->cmsg_len = CMSG_LEN(sizeof both);
  std::memcpy(CMSG_DATA(head), both.data(), sizeof both);
  return ::sendmsg(socket, &message.header, MSG_NOSIGNAL) == 1;
}

std::optional<Pair> receive_descriptors(int socket) {
  DescriptorMessage::Both both{-1, -1};
  DescriptorMessage message;
  ssize_t got = -1;
  do {
    got = ::recvmsg(socket, &message.header, MSG_CMSG_CLOEXEC);
  } while (got < 0 && errno == EINTR);
  const cmsghdr* const head = CMSG_FIRSTHDR(&message.header);
  if (got != 1 || head == nullptr || head->cmsg_len != CMSG_LEN(sizeof both)) return std::nullopt;
  std::memcpy(both.data(), CMSG_DATA(head), sizeof both);
  return Pair{Descriptor(both[0]), Descriptor(both[1])};
}

/// A direction of a relay.
class Buffer {
 public:
  bool full() const { return bytes_.size() >= LinkHelper::kBuffer; }
  bool empty() const { return bytes_.empty(); }
  std::span<std::uint8_t> room() { return room_; }
  std::span<const std::uint8_t> bytes() const { return bytes_; }
  void add(std::size_t n) {
    bytes_.insert(bytes_.end(), room_.begin(), room_.begin() + static_cast<std::ptrdiff_t>(n));
  }
  void remove(std::size_t n) { bytes_.erase(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(n)); }

 private:
  std::vector<std::uint8_t> bytes_;
  std::array<std::uint8_t, 65536> room_{};
};

/// Copies bytes between the rig's link and the process, until one of them closes.
class Relay {
 public:
  Relay(LinkPort& rig, int process, int messages) : rig_(rig), process_(process), messages_(messages) {}

  void run() {
    while (!process_gone_ && !rig_gone_) {
      const bool moved = from_rig() | to_process() | from_process() | to_rig();
      if (!moved) wait(kLookEvery);
    }
    if (process_gone_) say_farewell();
  }

 private:
  bool from_rig() {
    if (to_process_.full()) return false;
    const Result<std::size_t> got = rig_.read(to_process_.room());
    if (got) {
      to_process_.add(*got);
      return *got != 0;
    }
    // What the rig sent before it closed comes first.
    while (!to_process_.empty() && !process_gone_) {
      if (!to_process()) wait_for_process();
    }
    send_error(messages_, got.error());
    rig_gone_ = true;
    return true;
  }

  bool to_process() {
    if (to_process_.empty()) return false;
    const auto bytes = to_process_.bytes();
    const ssize_t sent = ::send(process_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent > 0) to_process_.remove(static_cast<std::size_t>(sent));
    if (sent < 0 && errno != EAGAIN && errno != EINTR) process_gone_ = true;
    return sent > 0;
  }

  bool from_process() {
    if (to_rig_.full()) return false;
    const ssize_t got = ::recv(process_, to_rig_.room().data(), to_rig_.room().size(), MSG_DONTWAIT);
    if (got > 0) to_rig_.add(static_cast<std::size_t>(got));
    if (got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR)) process_gone_ = true;
    return got > 0;
  }

  bool to_rig() {
    if (to_rig_.empty()) return false;
    const Result<std::size_t> sent = rig_.write(to_rig_.bytes());
    if (!sent) return false;  // the next read says why
    to_rig_.remove(*sent);
    return *sent != 0;
  }

  void wait(Duration at_most) {
    WakeUps wake_ups;
    rig_.add_wake_ups(wake_ups, !to_process_.full(), !to_rig_.empty());
    wake_ups.on({process_, !to_rig_.full(), !to_process_.empty()});
    wait_for(wake_ups, Instant(), at_most);
  }
  void wait_for_process() {
    WakeUps wake_ups;
    wake_ups.on({process_, false, true});
    wait_for(wake_ups, Instant(), kLookEvery);
  }

  /// Sends the rig the last bytes of a process that closed its link, such as its Bye.
  void say_farewell() {
    constexpr Duration kStep = Duration::milliseconds(50);
    for (Duration left = kFarewell; !to_rig_.empty() && left > Duration(); left = left - kStep) {
      if (to_rig()) continue;
      WakeUps wake_ups;
      rig_.add_wake_ups(wake_ups, false, true);
      wait_for(wake_ups, Instant(), kStep);
    }
  }

  LinkPort& rig_;
  int process_;
  int messages_;
  Buffer to_process_, to_rig_;
  bool process_gone_ = false, rig_gone_ = false;
};

void set_signals(std::initializer_list<int> signals, void (*action)(int)) {
  for (const int number : signals) ::signal(number, action);
}

/// The life of a link's own process.
[[noreturn]] void keep_link(const LinkHelper::Connect& connect, Descriptor bytes, Descriptor messages) {
  set_signals({SIGCHLD}, SIG_DFL);  // to learn how a program ended
  {
    const Result<std::unique_ptr<LinkPort>> link = connect();
    if (!link) {
      send_error(messages.get(), link.error());
      ::_exit(0);
    }
    send_success(messages.get(), (*link)->peer());
    Relay(**link, bytes.get(), messages.get()).run();
  }
  ::_exit(0);
}

/// The helper's life.
[[noreturn]] void help(const LinkHelper::Connect& connect, int requests) {
  // Signals for the process group are for the process; the helper ends when that closes its socket.
  set_signals({SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE, SIGCHLD}, SIG_IGN);
  ::prctl(PR_SET_NAME, "nodal-link");
  // The process's standard input and output end with the process, also for those at their other end.
  if (const int null = ::open("/dev/null", O_RDWR | O_CLOEXEC); null >= 0) {
    ::dup2(null, STDIN_FILENO);
    ::dup2(null, STDOUT_FILENO);
  }
  for (;;) {
    char nothing = 0;
    const ssize_t got = ::recv(requests, &nothing, 1, 0);
    if (got < 0 && errno == EINTR) continue;
    if (got != 1) ::_exit(0);
    std::optional<Pair> bytes = make_pair_of(SOCK_STREAM), messages = make_pair_of(SOCK_SEQPACKET);
    if (!bytes || !messages || !send_descriptors(requests, bytes->near.get(), messages->near.get())) ::_exit(1);
    bytes->near = Descriptor();
    messages->near = Descriptor();
    if (::fork() == 0) {
      ::close(requests);
      keep_link(connect, std::move(bytes->far), std::move(messages->far));
    }
  }
}

class HelpedLink final : public DescriptorLink {
 public:
  HelpedLink(Descriptor bytes, int fd, Descriptor messages, std::string peer)
      : DescriptorLink(std::move(bytes), fd, std::move(peer)), fd_(fd), messages_(std::move(messages)) {}
  /// Waits until the link's process has closed the rig's link and ended, but no longer than its farewell may take: a
  /// cable carries one host, so the next program would find it taken.
  ~HelpedLink() override {
    ::shutdown(fd_, SHUT_RDWR);
    pollfd ended{messages_.get(), 0, 0};  // POLLHUP is always reported
    (void)::poll(&ended, 1, static_cast<int>((kFarewell * 2).ms()));
  }

 private:
  std::string closed_because() override {
    const std::optional<Error> why = receive_error(messages_.get(), MSG_DONTWAIT);
    if (!why) return DescriptorLink::closed_because();
    const std::string named = peer() + ": ";  // which read() puts in front again
    return why->message.starts_with(named) ? why->message.substr(named.size()) : why->message;
  }

  const int fd_;
  Descriptor messages_;
};

tl::unexpected<Error> no_helper() {
  return fail(Errc::kIo, std::string("no process that connects to the rig: ") + std::strerror(errno));
}

}  // namespace

Result<std::unique_ptr<LinkHelper>> LinkHelper::start(const Connect& connect) {
  std::optional<Pair> ends = make_pair_of(SOCK_SEQPACKET);
  if (!ends) return no_helper();
  const pid_t helper = ::fork();
  if (helper < 0) return no_helper();
  if (helper == 0) {
    ends->near = Descriptor();
    help(connect, ends->far.get());
  }
  return std::unique_ptr<LinkHelper>(new LinkHelper(std::move(ends->near)));
}

Result<std::unique_ptr<LinkPort>> LinkHelper::connect() {
  const char nothing = 0;
  if (::send(requests_.get(), &nothing, 1, MSG_NOSIGNAL) != 1) return no_helper();
  std::optional<Pair> link = receive_descriptors(requests_.get());
  if (!link) return no_helper();
  const std::optional<Error> answer = receive_error(link->far.get(), 0);
  if (!answer) return no_helper();
  if (answer->code != static_cast<Errc>(0)) return fail(*answer);
  const int fd = link->near.get();
  return std::make_unique<HelpedLink>(std::move(link->near), fd, std::move(link->far), answer->message);
}

}  // namespace nodal::hal
