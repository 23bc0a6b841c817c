// The rig's half of a conversation, run in the same thread.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "hal/sim/link.h"
#include "host_tool/rig/rig_connection.h"
#include "protocol/upload.h"

namespace nodal::host {

/// The rig's end of a connection over a simulated link: sends answers that the test sets.
class FakeRig {
 public:
  using Answer = std::function<std::optional<wire::Reply>(const wire::Request&)>;

  explicit FakeRig(wire::Hello hello = make_hello("fake")) : session_(Role::kRig, hello) {
    auto [host, rig] = hal::sim::make_link_pair("sim:rig", "sim:host");
    host_end = std::move(host);
    link_ = std::move(rig);
  }

  Answer answer;
  std::unique_ptr<hal::sim::SimLink> host_end;
  UploadReceiver* uploads = nullptr;
  std::vector<wire::Request> requests;

  Session& session() { return session_; }
  hal::sim::SimLink* link() { return link_.get(); }
  void hang_up() { link_.reset(); }

  void step() {
    if (link_ == nullptr) return;
    std::vector<std::uint8_t> buffer(4096);
    const auto got = link_->read(buffer);
    if (got) (void)session_.receive(std::span(buffer).first(*got));
    while (std::optional<Event> event = session_.next_event()) handle(*event);
    for (auto out = session_.output(); !out.empty(); out = session_.output()) {
      const auto taken = link_->write(out);
      if (!taken || *taken == 0) break;
      session_.sent(*taken);
    }
  }

  WaitForLink waiter() {
    return [this](hal::LinkPort&, bool, Duration) { step(); };
  }

 private:
  void handle(const Event& event) {
    if (const auto* request = std::get_if<wire::Request>(&event)) {
      requests.push_back(*request);
      if (std::optional<wire::Reply> reply = answer ? answer(*request) : std::nullopt) {
        reply->set_id(request->id());
        EXPECT_TRUE(session_.send(*reply));
      }
    }
    if (const auto* piece = std::get_if<BulkPiece>(&event); piece != nullptr && uploads != nullptr) {
      EXPECT_TRUE(upload_stream_.piece(*piece, *uploads));
    }
  }

  Session session_;
  std::unique_ptr<hal::sim::SimLink> link_;
  UploadStream upload_stream_;
};

}  // namespace nodal::host
