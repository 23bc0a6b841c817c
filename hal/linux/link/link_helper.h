// Links for a process that gives up the right to open any: a helper process opens them and passes bytes on.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "hal/link.h"
#include "hal/linux/link/descriptor_link.h"
#include "protocol/base/result.h"

namespace nodal::hal {

/// start() forks the helper. For each link the helper forks a process that connects and then copies bytes in both
/// directions, with at most kBuffer bytes of each in memory. That process ends with the link, whose destructor waits
/// for it for at most 2 s; the helper ends with this object.
///
/// Threading: thread-bound. Call start() before the process has a second thread.
/// Ownership: links outlive it.
/// Errors: start(): kIo. connect(): those of `connect`, kIo. A link's kLinkClosed has the sentence of the link's own
/// error.
class LinkHelper {
 public:
  using Connect = std::function<Result<std::unique_ptr<LinkPort>>()>;
  static constexpr std::size_t kBuffer = 256 << 10;

  static Result<std::unique_ptr<LinkHelper>> start(const Connect& connect);
  LinkHelper(const LinkHelper&) = delete;
  LinkHelper& operator=(const LinkHelper&) = delete;

  /// A new link.
  Result<std::unique_ptr<LinkPort>> connect();

 private:
  explicit LinkHelper(Descriptor requests) : requests_(std::move(requests)) {}

  Descriptor requests_;  ///< a socket to the helper
};

}  // namespace nodal::hal
