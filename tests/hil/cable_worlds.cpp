// The two ends of the cable, nodald's and nodal's, with the tests that every link must pass.
#include <deque>
#include <future>
#include <thread>

#include "cable_gadget.h"
#include "hal/linux/cable/cable.h"
#include "hal/linux/cable/host/cable_link.h"
#include "hal/linux/link/wait.h"
#include "tests/conformance/link_conformance.h"

namespace nodal::hal {
namespace {

/// The guest's clock stands during computation, so a test that calls without waiting would never see a transfer end.
class SlowLink final : public LinkPort {
 public:
  explicit SlowLink(std::unique_ptr<LinkPort> link) : link_(std::move(link)) {}
  Result<std::size_t> read(std::span<std::uint8_t> into) override { return link_->read(into); }
  Result<std::size_t> write(std::span<const std::uint8_t> from) override {
    const auto n = link_->write(from);
    if (!n || *n > 0 || from.empty()) return n;
    WakeUps wake_ups;
    link_->add_wake_ups(wake_ups, false, true);
    wait_for(wake_ups, Instant(), Duration::milliseconds(20));
    return link_->write(from);
  }
  const std::string& peer() const override { return link_->peer(); }
  std::optional<PeerIdentity> identity() const override { return link_->identity(); }
  void add_wake_ups(WakeUps& to, bool to_read, bool to_write) const override {
    link_->add_wake_ups(to, to_read, to_write);
  }

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
  void add_wake_ups(WakeUps& to) const override {
    if (!accepted_.empty()) to.at(Instant());
    listener_->add_wake_ups(to);
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
