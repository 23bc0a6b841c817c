// The two ends of the cable, nodald's and nodal's, with the tests that every link must pass.
#include <poll.h>

#include <deque>
#include <future>
#include <thread>

#include "cable_gadget.h"
#include "hal/linux/cable/cable.h"
#include "hal/linux/cable/host/cable_link.h"
#include "hal/linux/link/socket_link.h"
#include "tests/conformance/link_conformance.h"

namespace nodal::hal {
namespace {

constexpr int kPollMs = 2000;

void poll_for(int fd, int at_most_ms) {
  pollfd wait{fd, POLLIN, 0};
  ::poll(&wait, 1, at_most_ms);
}

/// The guest's clock stands during computation, so a test that calls without waiting would never see a transfer end.
class SlowLink final : public LinkPort {
 public:
  explicit SlowLink(std::unique_ptr<LinkPort> link) : link_(std::move(link)) {}
  Result<std::size_t> read(std::span<std::uint8_t> into) override { return link_->read(into); }
  Result<std::size_t> write(std::span<const std::uint8_t> from) override {
    const auto n = link_->write(from);
    if (n && *n == 0) poll_for(link_descriptors(*link_).read_from, 1);
    return n;
  }
  const std::string& peer() const override { return link_->peer(); }
  std::optional<PeerIdentity> identity() const override { return link_->identity(); }
  LinkPort& inner() { return *link_; }

 private:
  std::unique_ptr<LinkPort> link_;
};

class CableWorld final : public LinkWorld, public LinkListenerPort {
 public:
  CableWorld() : gadget_("RIG7") {
    auto listener = cable::listen_cable(gadget_.folder(), "conformance");
    EXPECT_TRUE(listener) << listener.error().text();
    listener_ = std::move(*listener);
    gadget_.plug();
  }
  ~CableWorld() override { listener_.reset(); }

  LinkListenerPort& listener() override { return *this; }
  Result<std::unique_ptr<LinkPort>> accept() override {
    if (accepted_.empty()) return listener_->accept();
    auto link = std::move(accepted_.front());
    accepted_.pop_front();
    return link;
  }
  /// The rig's end must answer while the host connects, as nodald's control thread does.
  std::unique_ptr<LinkPort> connect() override {
    auto host = std::async(std::launch::async, [] { return cable::connect_cable("RIG7"); });
    while (host.wait_for(std::chrono::milliseconds(1)) != std::future_status::ready) {
      auto link = listener_->accept();
      if (link && *link) accepted_.push_back(std::move(*link));
    }
    auto link = host.get();
    EXPECT_TRUE(link) << link.error().text();
    return link ? std::make_unique<SlowLink>(std::move(*link)) : nullptr;
  }
  void drop_listener() override { listener_.reset(); }
  void wait_readable(LinkPort& link) override {
    auto* host = dynamic_cast<SlowLink*>(&link);
    poll_for(link_descriptors(host != nullptr ? host->inner() : link).read_from, kPollMs);
  }
  void wait_writable(LinkPort& link) override { wait_readable(link); }
  void wait_knocking() override {
    if (accepted_.empty()) poll_for(listener_descriptor(*listener_), kPollMs);
  }
  std::optional<PeerIdentity> host_identity() const override { return std::nullopt; }
  bool carries_several_hosts() const override { return false; }

 private:
  hil::CableGadget gadget_;
  std::unique_ptr<LinkListenerPort> listener_;
  std::deque<std::unique_ptr<LinkPort>> accepted_;
};

INSTANTIATE_TEST_SUITE_P(Cable, LinkConformance,
                         testing::Values(LinkWorldKind{"usb", [] { return std::make_unique<CableWorld>(); }}),
                         [](const auto& kind) { return kind.param.name; });

}  // namespace
}  // namespace nodal::hal
