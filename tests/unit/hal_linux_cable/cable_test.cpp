// The rig's end of the cable over a function whose host is the test.
#include "hal/linux/cable/cable.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <deque>
#include <vector>

#include "bytes.h"

namespace nodal::hal::cable {
namespace {

struct Transfer {
  std::size_t slot = 0;
  std::size_t bytes = 0;
};

/// What the host and the bus see of a function; outlives it.
struct Bus {
  std::deque<FunctionEvent> events;
  std::deque<Transfer> reads, writes;
  std::deque<Completion> completions;
  std::vector<Bytes> answers;
  int refused = 0;
  bool plugged = true;
  bool cancels = true;  ///< false: a controller that is slow to end cancelled transfers
  bool gone = false;
  std::array<std::array<std::uint8_t, kTransferBytes>, kTransfers> from_host{}, to_host{};

  void ask(std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t length) {
    events.push_back({FunctionEvent::Kind::kSetup, {type, request, value, 0, length}});
  }
  void ask_to_open() { ask(kOpenRequestType, kOpenRequest, kVersion, kAnswerBytes); }
  void send(std::span<const std::uint8_t> transfer) {
    ASSERT_FALSE(reads.empty());
    const std::size_t slot = reads.front().slot;
    reads.pop_front();
    std::copy(transfer.begin(), transfer.end(), from_host[slot].begin());
    completions.push_back({Direction::kFromHost, slot, static_cast<std::int64_t>(transfer.size())});
  }
  void send_record(std::uint16_t session, std::span<const std::uint8_t> payload) {
    std::array<std::uint8_t, kTransferBytes> bytes;
    send(std::span(bytes).first(write_record(session, payload, bytes).transfer));
  }
  /// Takes one transfer of the rig.
  Bytes take() {
    if (writes.empty()) return {};
    const Transfer transfer = writes.front();
    writes.pop_front();
    const auto& from = to_host[transfer.slot];
    completions.push_back({Direction::kToHost, transfer.slot, static_cast<std::int64_t>(transfer.bytes)});
    return {from.begin(), from.begin() + static_cast<std::ptrdiff_t>(transfer.bytes)};
  }
  void end_transfers(int error) {
    for (const Transfer& one : reads) completions.push_back({Direction::kFromHost, one.slot, -error});
    for (const Transfer& one : writes) completions.push_back({Direction::kToHost, one.slot, -error});
    reads.clear();
    writes.clear();
  }
  void unplug() {
    plugged = false;
    events.push_back({FunctionEvent::Kind::kDisabled, {}});
    end_transfers(ESHUTDOWN);
  }
};

class FakeFunction final : public UsbFunction {
 public:
  explicit FakeFunction(Bus& bus) : bus_(bus) {}
  Result<std::optional<FunctionEvent>> next_event() override {
    if (bus_.gone) return fail(Errc::kIo, "ep0: the gadget is gone");
    if (asked_ || bus_.events.empty()) return std::nullopt;
    const FunctionEvent event = bus_.events.front();
    bus_.events.pop_front();
    asked_ = event.kind == FunctionEvent::Kind::kSetup;
    return event;
  }
  void answer(std::span<const std::uint8_t> bytes) override {
    asked_ = false;
    bus_.answers.emplace_back(bytes.begin(), bytes.end());
  }
  void refuse(const Setup&) override {
    asked_ = false;
    ++bus_.refused;
  }
  std::span<std::uint8_t, kTransferBytes> buffer(Direction direction, std::size_t slot) override {
    return direction == Direction::kFromHost ? bus_.from_host[slot] : bus_.to_host[slot];
  }
  bool queue_read(std::size_t slot) override {
    if (bus_.plugged) bus_.reads.push_back({slot, kTransferBytes});
    return bus_.plugged;
  }
  bool queue_write(std::size_t slot, std::size_t bytes) override {
    if (bus_.plugged) bus_.writes.push_back({slot, bytes});
    return bus_.plugged;
  }
  void cancel_all() override {
    if (bus_.cancels) bus_.end_transfers(ECONNRESET);
  }
  std::optional<Completion> next_completion() override {
    if (bus_.completions.empty()) return std::nullopt;
    const Completion completion = bus_.completions.front();
    bus_.completions.pop_front();
    return completion;
  }
  int descriptor() const override { return -1; }
  void wait(Duration) override {}

 private:
  Bus& bus_;
  bool asked_ = false;
};

class CableTest : public testing::Test {
 protected:
  CableTest() : listener_(listen_over(std::make_unique<FakeFunction>(bus_), "usb:test")) {}

  std::unique_ptr<LinkPort> accept() { return listener_->accept().value(); }
  std::unique_ptr<LinkPort> open() {
    bus_.ask_to_open();
    auto link = accept();
    EXPECT_NE(link, nullptr);
    return link;
  }
  std::uint16_t session() const { return read_answer(bus_.answers.back())->session; }
  static Bytes read(LinkPort& link) {
    Bytes bytes(100'000);
    const auto n = link.read(bytes);
    EXPECT_TRUE(n) << n.error().text();
    bytes.resize(n.value_or(0));
    return bytes;
  }
  static Errc error_of(LinkPort& link) {
    Bytes bytes(10);
    const auto n = link.read(bytes);
    return n ? Errc::kInternal : n.error().code;
  }

  Bus bus_;
  std::unique_ptr<LinkListenerPort> listener_;
};

TEST_F(CableTest, NoHost_NothingIsQueuedAndNobodyIsAccepted) {
  EXPECT_EQ(accept(), nullptr);
  EXPECT_TRUE(bus_.reads.empty());
  EXPECT_TRUE(bus_.answers.empty());
}

TEST_F(CableTest, HostOpens_EightReadsOrMoreAreQueuedBeforeTheAnswer) {
  const auto link = open();
  ASSERT_EQ(bus_.answers.size(), 1u);
  EXPECT_EQ(bus_.reads.size(), kTransfers);
  EXPECT_GE(kTransfers, 8u);
  EXPECT_EQ(accept(), nullptr) << "a session is handed out once";
}

TEST_F(CableTest, BytesBothWays_ArriveInOrder) {
  const auto link = open();
  const Bytes bytes = numbered(3 * kMaxPayload + 5);
  bus_.send_record(session(), numbered(500));
  bus_.send_record(session(), numbered(1));
  Bytes expected = numbered(500);
  expected.push_back(1);
  EXPECT_EQ(read(*link), expected);
  EXPECT_EQ(link->write(bytes), bytes.size());
  RecordReader host(session());
  Bytes got;
  for (Bytes transfer = bus_.take(); !transfer.empty(); transfer = bus_.take()) {
    for (std::span<const std::uint8_t> rest(transfer); !rest.empty();) {
      const auto part = host.next(rest);
      ASSERT_TRUE(part) << part.error().text();
      got.insert(got.end(), part->begin(), part->end());
    }
  }
  EXPECT_EQ(got, bytes);
}

TEST_F(CableTest, HostDoesNotRead_WriteTakesWhatTheSlotsHoldAndThenNothing) {
  const auto link = open();
  const Bytes bytes = numbered(2 * kTransfers * kTransferBytes);
  EXPECT_EQ(link->write(bytes), kTransfers * kMaxPayload);
  EXPECT_EQ(link->write(bytes), 0u);
  bus_.take();
  EXPECT_EQ(link->write(bytes), kMaxPayload);
}

TEST_F(CableTest, HostKilledInTheMiddle_TheNextGetsNoByteOfIt) {
  const auto first = open();
  const std::uint16_t before = session();
  ASSERT_TRUE(first->write(numbered(100'000)));
  bus_.take();
  bus_.send_record(before, numbered(20));  // never read
  const auto second = open();
  EXPECT_NE(session(), before);
  EXPECT_TRUE(bus_.writes.empty());
  EXPECT_EQ(bus_.reads.size(), kTransfers);
  EXPECT_EQ(error_of(*first), Errc::kLinkClosed);
  EXPECT_EQ(first->write(numbered(1)).error().code, Errc::kLinkClosed);
  EXPECT_TRUE(read(*second).empty());
  bus_.send_record(session(), numbered(7));
  EXPECT_EQ(read(*second), numbered(7));
}

TEST_F(CableTest, TransfersAreSlowToEnd_TheAnswerWaitsForThem) {
  const auto first = open();
  ASSERT_TRUE(first->write(numbered(10)));
  bus_.cancels = false;
  bus_.ask_to_open();
  EXPECT_EQ(accept(), nullptr);
  EXPECT_EQ(bus_.answers.size(), 1u);
  bus_.end_transfers(ECONNRESET);
  EXPECT_NE(accept(), nullptr);
  EXPECT_EQ(bus_.answers.size(), 2u);
}

TEST_F(CableTest, RecordOfAnEarlierSession_EndsTheLinkAndIsNotRead) {
  open();
  const std::uint16_t before = session();
  const auto link = open();
  bus_.send_record(session(), numbered(4));
  bus_.send_record(before, numbered(5));
  EXPECT_EQ(read(*link), numbered(4));
  EXPECT_EQ(error_of(*link), Errc::kProtocol);
  EXPECT_FALSE(link->write(numbered(1)));
  EXPECT_NE(open(), nullptr) << "the next host starts afresh";
}

TEST_F(CableTest, Unplugged_BytesThatArrivedAreReadThenClosed) {
  const auto link = open();
  bus_.send_record(session(), numbered(9));
  bus_.unplug();
  EXPECT_EQ(read(*link), numbered(9));
  EXPECT_EQ(error_of(*link), Errc::kLinkClosed);
  EXPECT_EQ(link->write(numbered(1)).error().code, Errc::kLinkClosed);
  bus_.plugged = true;
  bus_.events.push_back({FunctionEvent::Kind::kEnabled, {}});
  EXPECT_EQ(accept(), nullptr);
  const auto next = open();
  bus_.send_record(session(), numbered(2));
  EXPECT_EQ(read(*next), numbered(2));
}

TEST_F(CableTest, UnpluggedDuringTheRequest_ThereIsNoSession) {
  bus_.ask_to_open();
  bus_.unplug();
  const auto link = accept();
  EXPECT_TRUE(!link || error_of(*link) == Errc::kLinkClosed);
  EXPECT_TRUE(bus_.reads.empty());
}

TEST_F(CableTest, LinkDropped_HostIsToldAfterTheBytesBefore) {
  auto link = open();
  const std::uint16_t now = session();
  ASSERT_EQ(link->write(numbered(kTransfers * kMaxPayload)), kTransfers * kMaxPayload);
  link.reset();  // no slot is free for the last record
  RecordReader host(now);
  std::size_t bytes = 0;
  for (int i = 0; i < 100 && !host.ended(); ++i) {
    const Bytes transfer = bus_.take();
    for (std::span<const std::uint8_t> rest(transfer); !rest.empty();) bytes += host.next(rest)->size();
    accept();
  }
  EXPECT_TRUE(host.ended());
  EXPECT_EQ(bytes, kTransfers * kMaxPayload);
}

TEST_F(CableTest, LinkDropped_WhatTheHostStillSendsIsTaken) {
  auto link = open();
  const std::uint16_t now = session();
  link.reset();
  for (std::size_t i = 0; i < 3 * kTransfers; ++i) {
    ASSERT_NO_FATAL_FAILURE(bus_.send_record(now, numbered(100)));
    accept();
  }
}

TEST_F(CableTest, HostEndsTheSession_ClosedAfterItsBytes) {
  const auto link = open();
  bus_.send_record(session(), numbered(3));
  bus_.send_record(session(), {});
  EXPECT_EQ(read(*link), numbered(3));
  EXPECT_EQ(error_of(*link), Errc::kLinkClosed);
}

TEST_F(CableTest, RequestsThatAreNotTheOne_AreRefusedAndChangeNothing) {
  const auto link = open();
  const std::uint16_t now = session();
  for (int type = 0; type < 256; ++type) {
    for (const int length : {0, 1, 7, 8, 65535}) {
      const bool is_it = type == kOpenRequestType && length >= int{kAnswerBytes};
      bus_.ask(static_cast<std::uint8_t>(type), is_it ? kOpenRequest + 1 : kOpenRequest, kVersion,
               static_cast<std::uint16_t>(length));
    }
  }
  const int asked = static_cast<int>(bus_.events.size());
  for (int i = 0; i < asked; ++i) EXPECT_EQ(accept(), nullptr);
  EXPECT_EQ(bus_.refused, asked);
  EXPECT_EQ(bus_.answers.size(), 1u);
  bus_.send_record(now, numbered(3));
  EXPECT_EQ(read(*link), numbered(3));
}

TEST_F(CableTest, HostOfAnotherVersion_IsToldTheRigsAndDisturbsNobody) {
  const auto link = open();
  const std::uint16_t now = session();
  for (const int version : {0, 2, 65535}) {
    bus_.ask(kOpenRequestType, kOpenRequest, static_cast<std::uint16_t>(version), 65535);
    EXPECT_EQ(accept(), nullptr);
    EXPECT_EQ(read_answer(bus_.answers.back())->version, kVersion);
  }
  bus_.send_record(now, numbered(3));
  EXPECT_EQ(read(*link), numbered(3));
}

TEST_F(CableTest, RequestsWithoutAPause_LeaveTimeForOtherWork) {
  for (int i = 0; i < 1000; ++i) bus_.ask(0xff, 0, 0, 0);
  accept();
  EXPECT_EQ(bus_.events.size(), 1000u - Cable::kEventsAPump);
}

TEST_F(CableTest, MoreSessionsThanTheirNumberHasBits_EachWorks) {
  for (int i = 0; i < 65537; ++i) bus_.ask_to_open(), accept();
  EXPECT_EQ(session(), 1u);
  const auto link = open();
  EXPECT_EQ(session(), 2u);
  bus_.send_record(session(), numbered(5));
  EXPECT_EQ(read(*link), numbered(5));
}

TEST_F(CableTest, GadgetTakenAway_ListenerAndLinkSaySo) {
  const auto link = open();
  bus_.gone = true;
  EXPECT_EQ(error_of(*link), Errc::kLinkClosed);
  const auto next = listener_->accept();
  ASSERT_FALSE(next);
  EXPECT_EQ(next.error().code, Errc::kIo);
}

}  // namespace
}  // namespace nodal::hal::cable
