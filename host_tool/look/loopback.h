// What `nodal look` needs before it gives up its rights: the socket that it serves on, its secret, and a process that
// can start a browser.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "hal/linux/link/descriptor_link.h"
#include "protocol/base/result.h"

namespace nodal::host::look {

/// A listening TCP socket on 127.0.0.1 at a free port: no other machine reaches it.
struct Loopback {
  hal::Descriptor socket;
  std::uint16_t port = 0;
};
/// Errors: kIo.
Result<Loopback> listen_on_loopback();

/// 128 random bits as 32 hexadecimal digits. Errors: kIo.
Result<std::string> make_token();

/// A process that waits for a link and then becomes the user's browser. It keeps the rights that the caller gives up,
/// and reads nothing but the link.
///
/// Threading: thread-bound. Call start() before the process has a second thread.
/// Ownership: the process ends when this object does, unless it has become the browser.
/// Errors: start(): kIo. When there is no xdg-open, the process says so on standard error.
class BrowserStarter {
 public:
  static Result<std::unique_ptr<BrowserStarter>> start();
  void open(const std::string& link);

 private:
  explicit BrowserStarter(hal::Descriptor pipe) : pipe_(std::move(pipe)) {}
  hal::Descriptor pipe_;
};

/// All of it.
struct Prepared {
  Loopback loopback;
  std::unique_ptr<BrowserStarter> browser;  ///< null: not asked for
};
Result<Prepared> prepare(bool open);

}  // namespace nodal::host::look
