#include "tests/scenario/stand.h"

#include <gtest/gtest.h>

#include <array>

namespace nodal::scenario {
namespace {

hal::sim::SimRigOptions virtual_time(const StandOptions& options) {
  hal::sim::SimRigOptions world = options.world;
  world.real_time = false;
  world.head.pixels = options.config.heads[0].format;
  world.head.rate = options.config.rate;
  world.head.buffers = options.config.takes ? static_cast<int>(firmware::kFramesAHead) : 8;
  world.head.supersampling = 2;
  return world;
}

}  // namespace

TestHost::TestHost(Stand& stand, hal::sim::SimLinkListener& listener, hal::PeerIdentity who)
    : stand_(stand), link_(listener.connect(who)), session_(Role::kHost, make_hello("a test")) {}

void TestHost::pump() {
  if (gone_) return;
  std::array<std::uint8_t, 16384> bytes;
  while (reading && session_.wants_input()) {
    const auto read = link_->read(bytes);
    if (!read) {
      gone_ = true;
      return;
    }
    if (*read == 0 || !session_.receive(std::span(bytes).first(*read))) break;
    while (auto event = session_.next_event()) {
      if (auto* reply = std::get_if<wire::Reply>(&*event)) {
        replies_[reply->id()] = *reply;
      } else if (auto* piece = std::get_if<BulkPiece>(&*event)) {
        auto& items = pulled[piece->stream];
        dropped[piece->stream] = piece->dropped;
        if (piece->first) {
          items.emplace_back();
          items.back().meta = piece->meta;
          // A frame set's header is another message; its test parses it.
          if (!items.back().header.ParseFromString(piece->meta)) items.back().header.Clear();
        }
        items.back().body.insert(items.back().body.end(), piece->data.begin(), piece->data.end());
      } else if (auto* end = std::get_if<StreamClosed>(&*event)) {
        closed[end->stream] = end->error;
        dropped[end->stream] = end->dropped;
      }
    }
  }
  while (!session_.output().empty()) {
    const auto wrote = link_->write(session_.output());
    if (!wrote) {
      gone_ = true;
      return;
    }
    if (*wrote == 0) break;
    session_.sent(*wrote);
  }
}

std::uint64_t TestHost::post(wire::Request request) {
  request.set_id(next_id_++);
  EXPECT_TRUE(session_.send(request));
  return request.id();
}

const wire::Reply* TestHost::reply(std::uint64_t id) const {
  const auto found = replies_.find(id);
  return found == replies_.end() ? nullptr : &found->second;
}

wire::Reply TestHost::ask(wire::Request request) {
  const std::uint64_t id = post(std::move(request));
  EXPECT_TRUE(stand_.run_until([&] { return reply(id) != nullptr || dead(); })) << "no answer";
  const wire::Reply* answer = reply(id);
  return answer ? *answer : wire::Reply();
}

wire::RigStatus TestHost::status() {
  wire::Request request;
  request.mutable_status();
  return ask(request).status();
}

wire::Heads TestHost::heads() {
  wire::Request request;
  request.mutable_heads();
  return ask(request).heads();
}

std::uint64_t TestHost::send_document(const std::string& document) {
  const auto bytes = std::make_shared<const std::vector<std::uint8_t>>(document.begin(), document.end());
  const UploadSender sender(bytes);
  wire::Request begin;
  *begin.mutable_upload_begin() = sender.begin();
  const wire::Reply state = ask(begin);
  if (!state.has_upload()) return 0;
  const auto stream = session_.open_stream(StreamPolicy::kLossless);
  EXPECT_TRUE(stream);
  EXPECT_TRUE(session_.offer(*stream, *sender.item(state.upload().offset())));
  session_.close_stream(*stream);
  uploading_ = *stream;
  return state.upload().offset();
}

wire::Reply TestHost::upload(const std::string& document) {
  send_document(document);
  // Control frames overtake bulk frames: the commit waits until the last byte has been sent.
  EXPECT_TRUE(stand_.run_until([&] { return dead() || !uploading_ || !session_.counts(*uploading_); }));
  const auto bytes = std::make_shared<const std::vector<std::uint8_t>>(document.begin(), document.end());
  wire::Request commit;
  *commit.mutable_upload_commit() = UploadSender(bytes).commit();
  return ask(commit);
}

StreamId TestHost::pull(bool jpeg, std::uint64_t count, bool lossless) {
  wire::Request request;
  request.mutable_pull()->set_coding(jpeg ? wire::PullRequest::JPEG : wire::PullRequest::RAW);
  request.mutable_pull()->set_count(count);
  request.mutable_pull()->set_lossless(lossless);
  const wire::Reply answer = ask(request);
  refusal = answer.error();
  return answer.has_pull() ? answer.pull().stream() : 0;
}

Stand::Stand(StandOptions wanted, std::unique_ptr<hal::sim::SimDisk> its_disk,
             std::unique_ptr<hal::sim::SimDisk> its_takes)
    : options(std::move(wanted)),
      world(options.truth, virtual_time(options)),
      disk(its_disk ? std::move(its_disk) : std::make_unique<hal::sim::SimDisk>()),
      watchdog(world.clock()),
      button(world.clock()) {
  if (options.config.takes) takes = its_takes ? std::move(its_takes) : std::make_unique<hal::sim::SimDisk>();
  rig = std::make_unique<firmware::Rig>(
      options.config,
      firmware::RigPorts{
          world.clock(),
          world.enumerator(),
          &world.trigger(),
          *disk,
          {{&listener}, {&view_listener, firmware::Access::kView}, {&operate_listener, firmware::Access::kOperate}},
          &watchdog,
          {&button, &status_lamp, &tally_lamp},
          nullptr,
          options.scan,
          takes.get(),
          takes.get(),
          nullptr,
          options.rehearsal},
      "a rig");
}

Stand::~Stand() {
  hosts.clear();
  if (!rig) return;
  rig->close();
  check_conserved();
  EXPECT_EQ(capture().frames.held, 0u);
}

void Stand::settle() {
  constexpr int kMany = 10'000;
  for (int i = 0; i < kMany; ++i) {
    bool busy = rig->step_all();
    for (const auto& host : hosts) host->pump();
    if (!busy) return;
  }
  FAIL() << "the rig does not come to rest";
}

void Stand::run(Duration duration) {
  const Instant end = world.clock().now() + duration;
  while (world.clock().now() < end) {
    world.clock().advance(tick);
    settle();
    check_conserved();
  }
}

bool Stand::run_until(const std::function<bool()>& holds, Duration at_most) {
  const Instant end = world.clock().now() + at_most;
  settle();
  while (!holds()) {
    if (world.clock().now() >= end) return false;
    run(tick);
  }
  return true;
}

/// Compares the rig's counters with the simulated heads' counters.
void Stand::check_conserved() {
  for (int i = 0; i < world.head_count(); ++i) {
    const firmware::FrameCounts& counts = capture().heads[static_cast<std::size_t>(i)].counts;
    ASSERT_EQ(counts.frames, counts.in_sets + counts.held + counts.lost()) << "head " << i;
    ASSERT_EQ(counts.frames, world.head(i).counts().taken) << "head " << i;
  }
}

TestHost& Stand::connect(hal::PeerIdentity who) {
  hosts.push_back(std::make_unique<TestHost>(*this, listener, who));
  return *hosts.back();
}

TestHost& Stand::connect_to_view() {
  hosts.push_back(std::make_unique<TestHost>(*this, view_listener));
  return *hosts.back();
}

TestHost& Stand::connect_to_operate() {
  hosts.push_back(std::make_unique<TestHost>(*this, operate_listener));
  return *hosts.back();
}

TestHost& Stand::bring_up() {
  TestHost& host = connect();
  const wire::Reply done = host.upload(to_json(options.truth));
  EXPECT_TRUE(done.has_done()) << done.error().message();
  run(Duration::seconds(1));  // by then the grid has found the free-running heads
  return host;
}

void Stand::lock(TestHost& host) {
  wire::Request start;
  start.mutable_genlock()->set_action(wire::GenlockRequest::START);
  EXPECT_TRUE(host.ask(start).has_genlock());
  EXPECT_TRUE(run_until([&] { return capture().genlock.state == firmware::GenlockState::kLocked; }));
  run(Duration::milliseconds(200));
}

std::uint64_t Stand::losses(int head, firmware::LossReason reason) {
  return capture().heads[static_cast<std::size_t>(head)].counts.losses[static_cast<std::size_t>(reason)];
}

}  // namespace nodal::scenario
