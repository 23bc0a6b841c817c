// The LinkWorlds of all implementations.
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <deque>
#include <filesystem>

#include "hal/linux/link/socket_link.h"
#include "hal/sim/link.h"
#include "link_conformance.h"

namespace nodal::hal {
namespace {

class SimWorld final : public LinkWorld {
 public:
  explicit SimWorld(std::uint32_t split) : split_(split) {}
  LinkListenerPort& listener() override { return *listener_; }
  std::unique_ptr<LinkPort> connect() override {
    auto link = listener_->connect();
    link->in().split = split_;
    link->out().split = split_;
    return link;
  }
  void drop_listener() override { listener_.reset(); }
  std::optional<PeerIdentity> host_identity() const override { return PeerIdentity{1000, 4711}; }

 private:
  std::uint32_t split_;
  std::unique_ptr<sim::SimLinkListener> listener_ = std::make_unique<sim::SimLinkListener>();
};

class SocketWorld final : public LinkWorld {
 public:
  SocketWorld() {
    std::string folder = std::filesystem::temp_directory_path() / "nodal-link-XXXXXX";
    folder_ = ::mkdtemp(folder.data());
    auto listener = listen_link("unix:" + folder_ + "/socket");
    NODAL_ASSERT(listener.has_value());
    listener_ = std::move(*listener);
    address_ = listener_address(*listener_);
  }
  ~SocketWorld() override {
    listener_.reset();
    std::filesystem::remove_all(folder_);
  }
  LinkListenerPort& listener() override { return *listener_; }
  std::unique_ptr<LinkPort> connect() override {
    auto link = connect_link(address_);
    EXPECT_TRUE(link) << link.error().text();
    return link ? std::move(*link) : nullptr;
  }
  void drop_listener() override { listener_.reset(); }
  std::optional<PeerIdentity> host_identity() const override { return PeerIdentity{::getuid(), ::getpid()}; }

 private:
  std::string folder_;
  std::string address_;
  std::unique_ptr<LinkListenerPort> listener_;
};

/// Pairs of pipes, like a program's standard input and output.
class PipeWorld final : public LinkWorld {
 public:
  class Listener final : public LinkListenerPort {
   public:
    Result<std::unique_ptr<LinkPort>> accept() override {
      if (knocking.empty()) return nullptr;
      auto link = std::move(knocking.front());
      knocking.pop_front();
      return link;
    }
    void add_wake_ups(WakeUps& to) const override {
      if (!knocking.empty()) to.at(Instant());
    }
    std::deque<std::unique_ptr<LinkPort>> knocking;
  };
  LinkListenerPort& listener() override { return *listener_; }
  std::unique_ptr<LinkPort> connect() override {
    int up[2], down[2];
    NODAL_ASSERT(::pipe(up) == 0 && ::pipe(down) == 0);
    listener_->knocking.push_back(descriptor_link(up[0], down[1], "pipe:host").value());
    return descriptor_link(down[0], up[1], "pipe:rig").value();
  }
  void drop_listener() override { listener_.reset(); }
  std::optional<PeerIdentity> host_identity() const override { return std::nullopt; }

 private:
  std::unique_ptr<Listener> listener_ = std::make_unique<Listener>();
};

INSTANTIATE_TEST_SUITE_P(Links, LinkConformance,
                         testing::Values(LinkWorldKind{"sim", [] { return std::make_unique<SimWorld>(0); }},
                                         LinkWorldKind{"sim_split", [] { return std::make_unique<SimWorld>(900); }},
                                         LinkWorldKind{"unix", [] { return std::make_unique<SocketWorld>(); }},
                                         LinkWorldKind{"pipe", [] { return std::make_unique<PipeWorld>(); }}),
                         [](const auto& kind) { return kind.param.name; });

}  // namespace
}  // namespace nodal::hal
