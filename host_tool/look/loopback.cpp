#include "host_tool/look/loopback.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "protocol/base/try.h"

namespace nodal::host::look {
namespace {

constexpr int kBacklog = 128;

tl::unexpected<Error> failed(const std::string& what) { return fail(Errc::kIo, what + ": " + std::strerror(errno)); }

[[noreturn]] void wait_for_link(int pipe) {
  // Up to the end of a line: processes that are forked later keep the pipe's other end open.
  std::string link;
  for (char c = 0; c != '\n';) {
    const ssize_t got = ::read(pipe, &c, 1);
    if (got < 0 && errno == EINTR) continue;
    if (got != 1) ::_exit(0);
    if (c != '\n') link += c;
  }
  // Ctrl-C in the terminal ends nodal, not the browser.
  ::setsid();
  ::execlp("xdg-open", "xdg-open", link.c_str(), nullptr);
  const std::string sorry = "nodal: --open needs xdg-open (Debian's xdg-utils); open the link yourself\n";
  (void)!::write(STDERR_FILENO, sorry.data(), sorry.size());
  ::_exit(1);
}

}  // namespace

Result<Loopback> listen_on_loopback() {
  Loopback made{hal::Descriptor(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)), 0};
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  auto* const any = reinterpret_cast<sockaddr*>(&address);
  if (made.socket.get() < 0 || ::bind(made.socket.get(), any, size) != 0 ||
      ::listen(made.socket.get(), kBacklog) != 0 || ::getsockname(made.socket.get(), any, &size) != 0) {
    return failed("no socket on 127.0.0.1 for the page");
  }
  made.port = ntohs(address.sin_port);
  return made;
}

Result<std::string> make_token() {
  std::array<unsigned char, 16> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) return failed("no random bits");
  std::string token;
  for (const unsigned char byte : bytes) {
    token += "0123456789abcdef"[byte >> 4];
    token += "0123456789abcdef"[byte & 15];
  }
  return token;
}

Result<std::unique_ptr<BrowserStarter>> BrowserStarter::start() {
  std::array<int, 2> ends{-1, -1};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) return failed("no process for the browser");
  hal::Descriptor reads(ends[0]), writes(ends[1]);
  const pid_t child = ::fork();
  if (child < 0) return failed("no process for the browser");
  if (child == 0) {
    ::close(writes.release());
    wait_for_link(reads.get());
  }
  return std::unique_ptr<BrowserStarter>(new BrowserStarter(std::move(writes)));
}

void BrowserStarter::open(const std::string& link) {
  const std::string line = link + "\n";
  (void)!::write(pipe_.get(), line.data(), line.size());
  pipe_ = hal::Descriptor();
}

Result<Prepared> prepare(bool open) {
  Prepared made;
  NODAL_TRY_ASSIGN(made.loopback, listen_on_loopback());
  if (open) {
    NODAL_TRY_ASSIGN(made.browser, BrowserStarter::start());
  }
  return made;
}

}  // namespace nodal::host::look
