// The tests that every LinkPort and LinkListenerPort must pass. To add an implementation: add a LinkWorld and one
// INSTANTIATE_TEST_SUITE_P line.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <optional>
#include <ostream>
#include <string>

#include "hal/link.h"

namespace nodal::hal {

/// An environment in which links are made.
class LinkWorld {
 public:
  virtual ~LinkWorld() = default;
  virtual LinkListenerPort& listener() = 0;
  virtual std::unique_ptr<LinkPort> connect() = 0;
  /// Destroys the listener; links stay open.
  virtual void drop_listener() = 0;
  /// The process that calls connect(), as the rig's end must report it; nothing if the kernel does not report it.
  virtual std::optional<PeerIdentity> host_identity() const = 0;
  /// False for a USB cable, whose second host is refused; its own tests show that.
  virtual bool carries_several_hosts() const { return true; }
};

struct LinkWorldKind {
  std::string name;
  std::function<std::unique_ptr<LinkWorld>()> make;
  friend std::ostream& operator<<(std::ostream& out, const LinkWorldKind& kind) { return out << kind.name; }
};

class LinkConformance : public testing::TestWithParam<LinkWorldKind> {};

}  // namespace nodal::hal
