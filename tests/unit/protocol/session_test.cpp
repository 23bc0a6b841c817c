#include "protocol/session.h"

#include <gtest/gtest.h>

#include "conversation.h"

namespace nodal {
namespace {

wire::Request status_request(std::uint64_t id) {
  wire::Request request;
  request.set_id(id);
  request.mutable_status();
  return request;
}

TEST(Session, FirstBytes_HelloComesFirstOnBothEnds) {
  Conversation talk;
  ASSERT_TRUE(talk.host->send(status_request(1))) << "a request may be made before the hello came";
  talk.run();
  ASSERT_EQ(talk.at_host.size(), 1u);
  ASSERT_EQ(talk.at_rig.size(), 2u);
  EXPECT_EQ(std::get<wire::Hello>(talk.at_host[0]).software(), "nodald test");
  EXPECT_EQ(std::get<wire::Hello>(talk.at_rig[0]).software(), "nodal test");
  ASSERT_NE(talk.host->peer_hello(), nullptr);
  EXPECT_EQ(talk.host->peer_hello()->software(), "nodald test");
  EXPECT_EQ(talk.host->version(), kProtocolMax);
}

TEST(Session, RequestAndReply_ArriveAsSent) {
  Conversation talk;
  ASSERT_TRUE(talk.host->send(status_request(7)));
  talk.run();
  const auto requests = only<wire::Request>(talk.at_rig);
  ASSERT_EQ(requests.size(), 1u);
  EXPECT_EQ(requests[0].id(), 7u);
  EXPECT_EQ(requests[0].what_case(), wire::Request::kStatus);

  wire::Reply reply;
  reply.set_id(7);
  reply.mutable_status()->set_state("running");
  ASSERT_TRUE(talk.rig->send(reply));
  talk.run();
  const auto replies = only<wire::Reply>(talk.at_host);
  ASSERT_EQ(replies.size(), 1u);
  EXPECT_EQ(replies[0].status().state(), "running");
}

// LIMITS.md: lists in a reply; refused before it is parsed.
TEST(Session, AReplyOfMoreThanItsLimitThatIsNoCalibration_EndsTheSession) {
  for (const bool calibration : {true, false}) {
    Conversation talk;
    talk.run();
    wire::Reply reply;
    const std::string text(kMaxListReplyBytes + 1, 'x');
    if (calibration) reply.mutable_calibration()->set_json(text);
    else reply.mutable_status()->set_state(text);
    ASSERT_TRUE(talk.rig->send(reply));
    const Status received = talk.host->receive(take_output(*talk.rig));
    EXPECT_EQ(received.has_value(), calibration);
    EXPECT_EQ(received ? Errc::kTooLarge : received.error().code, Errc::kTooLarge);
  }
}

wire::Hello hello_of(std::string software, std::uint32_t low, std::uint32_t high) {
  wire::Hello hello = make_hello(std::move(software));
  hello.set_protocol_min(low);
  hello.set_protocol_max(high);
  return hello;
}

TEST(Session, VersionRangesOverlap_HighestInCommonIsSpoken) {
  Session host(Role::kHost, hello_of("host", 2, 5));
  Session rig(Role::kRig, hello_of("rig", 1, 3));
  ASSERT_TRUE(host.receive(take_output(rig)));
  ASSERT_TRUE(rig.receive(take_output(host)));
  EXPECT_EQ(host.version(), 3u);
  EXPECT_EQ(rig.version(), 3u);
}

TEST(Session, AHelloOfMoreFeaturesThanAreKept_KeepsTheFirst) {
  wire::Hello hello = make_hello("a host");
  for (int k = 0; k <= kMaxFeatures; ++k) hello.add_features(std::to_string(k));
  Session host(Role::kHost, hello), rig(Role::kRig, make_hello("rig"));
  ASSERT_TRUE(rig.receive(take_output(host)));
  ASSERT_EQ(rig.peer_hello()->features_size(), kMaxFeatures);
  EXPECT_EQ(rig.peer_hello()->features(0), "0");
  EXPECT_EQ(rig.peer_hello()->features(kMaxFeatures - 1), std::to_string(kMaxFeatures - 1));
}

TEST(Session, NoVersionInCommon_BothEndsDieAndSayWhichIsTooOld) {
  for (const bool host_is_old : {true, false}) {
    Session host(Role::kHost, host_is_old ? hello_of("nodal 0.1", 1, 1) : hello_of("nodal 9", 4, 6));
    Session rig(Role::kRig, host_is_old ? hello_of("nodald 9", 4, 6) : hello_of("nodald 0.1", 1, 1));
    const auto from_host = take_output(host);
    const auto from_rig = take_output(rig);
    for (const auto& [status, old] :
         {std::pair{host.receive(from_rig), host_is_old ? "this host (nodal 0.1)" : "the rig (nodald 0.1)"},
          std::pair{rig.receive(from_host), host_is_old ? "the host (nodal 0.1)" : "this rig (nodald 0.1)"}}) {
      ASSERT_FALSE(status);
      EXPECT_EQ(status.error().code, Errc::kVersionMismatch);
      EXPECT_NE(status.error().message.find(std::string(old) + " is too old, update it"), std::string::npos)
          << status.error().message;
    }
    EXPECT_TRUE(take_events(host).empty());
  }
}

TEST(Session, HelloWithoutARange_Protocol) {
  for (const auto& [low, high] : {std::pair{0U, 0U}, std::pair{3U, 2U}}) {
    Session host(Role::kHost, make_hello("host"));
    Session rig(Role::kRig, hello_of("rig", low, high));
    EXPECT_EQ(host.receive(take_output(rig)).error().code, Errc::kProtocol);
  }
}

TEST(Session, DeadSession_SaysWhyOnEveryCallAndTellsThePeer) {
  Conversation talk;
  talk.run();
  talk.rig->close(Error{Errc::kCancelled, "the rig shuts down"});
  EXPECT_EQ(talk.rig->send(wire::Reply()).error().code, Errc::kCancelled);
  EXPECT_EQ(talk.rig->open_stream(StreamPolicy::kLatest).error().code, Errc::kCancelled);
  EXPECT_EQ(talk.rig->receive({}).error().code, Errc::kCancelled);
  EXPECT_FALSE(talk.rig->wants_input());
  talk.run();
  ASSERT_NE(talk.host->error(), nullptr);
  EXPECT_EQ(talk.host->error()->code, Errc::kCancelled);
  EXPECT_EQ(talk.host->error()->message, "the rig (nodald test) ended the session: the rig shuts down");
  EXPECT_TRUE(take_output(*talk.host).empty()) << "a farewell is not answered";
}

TEST(Session, RepliesBeforeTheFarewell_StillArrive) {
  Conversation talk;
  talk.run();
  wire::Reply reply;
  reply.set_id(5);
  ASSERT_TRUE(talk.rig->send(reply));
  talk.rig->close(Error{Errc::kCancelled, "bye"});
  talk.run();
  ASSERT_EQ(only<wire::Reply>(talk.at_host).size(), 1u);
  EXPECT_EQ(only<wire::Reply>(talk.at_host)[0].id(), 5u);
}

TEST(Session, PeerNameWithControlCharacters_IsHarmlessInMessages) {
  Session host(Role::kHost, make_hello("host"));
  Session rig(Role::kRig, hello_of("evil\x1B[2J\n" + std::string(500, 'x'), 7, 7));
  const std::string message = host.receive(take_output(rig)).error().message;
  EXPECT_EQ(message.find('\x1B'), std::string::npos);
  EXPECT_EQ(message.find('\n'), std::string::npos);
  EXPECT_LT(message.size(), 400u);
}

TEST(Session, TextThatIsNotUtf8_RefusedHereAndNotByThePeer) {
  Conversation talk;
  wire::Reply reply;
  reply.mutable_status()->set_state("\xFF");
  EXPECT_EQ(talk.rig->send(reply).error().code, Errc::kBadValue);
  wire::Reply error;
  error.mutable_error()->set_message("/dev/\xFF is gone");
  EXPECT_TRUE(talk.rig->send(error)) << "an error gets through whatever the file is called";
  talk.run();
  ASSERT_EQ(only<wire::Reply>(talk.at_host).size(), 1u);
  EXPECT_EQ(only<wire::Reply>(talk.at_host)[0].error().message(), "/dev/\xEF\xBF\xBD is gone");
}

TEST(Session, MessageOverItsLimit_TooLargeAndTheSessionLives) {
  Conversation talk;
  wire::Reply reply;
  reply.mutable_calibration()->set_json(std::string(kMaxReplyBytes + 1, ' '));
  EXPECT_EQ(talk.rig->send(reply).error().code, Errc::kTooLarge);
  reply.mutable_calibration()->set_json(std::string(1U << 20, ' '));
  EXPECT_TRUE(talk.rig->send(reply)) << "the longest calibration fits";
  talk.run();
  EXPECT_EQ(only<wire::Reply>(talk.at_host).size(), 1u);
}

TEST(Session, PeerThatDoesNotRead_RepliesEndInOverloadAndRequestsAreLeftInTheLink) {
  Conversation talk;
  talk.run();
  wire::Reply reply;
  reply.mutable_calibration()->set_json(std::string(1U << 20, ' '));
  std::size_t taken = 0;
  while (talk.rig->send(reply)) ASSERT_LT(++taken, 20u) << "nothing bounds the queue";
  EXPECT_EQ(talk.rig->send(reply).error().code, Errc::kOverload);
  EXPECT_EQ(taken, kMaxRigControlQueueBytes / (1U << 20) - 1);
  EXPECT_EQ(talk.rig->error(), nullptr);
}

TEST(Session, EventsNotTaken_SessionStopsWantingInputAndGoesOnLater) {
  Conversation talk;
  talk.run();
  wire::Request request;
  request.mutable_calibration_get()->set_id(std::string(60'000, 'x'));
  std::vector<std::uint8_t> left;
  for (int i = 0; i < 1000 && talk.rig->wants_input(); ++i) {
    ASSERT_TRUE(talk.host->send(request));
    ASSERT_TRUE(talk.rig->receive(take_output(*talk.host)));
  }
  ASSERT_TRUE(talk.host->send(request));
  left = take_output(*talk.host);
  EXPECT_FALSE(talk.rig->wants_input());
  EXPECT_EQ(talk.rig->receive(left).error().code, Errc::kOverload);
  EXPECT_EQ(talk.rig->error(), nullptr);
  const std::size_t before = take_events(*talk.rig).size();
  EXPECT_LE(before, kMaxRigEventQueueBytes / 60'000 + 1);
  EXPECT_TRUE(talk.rig->receive(left)) << "nothing was lost meanwhile";
  EXPECT_EQ(take_events(*talk.rig).size(), 1u);
}

TEST(Session, RulesOfOrder_BrokenOnesAreNamed) {
  struct Case {
    FrameType type;
    StreamId stream;
    bool after_hello;
    const char* says;
  };
  const Case cases[] = {{FrameType::kRequest, 0, false, "not a hello"}, {FrameType::kHello, 0, true, "second hello"},
                        {FrameType::kReply, 0, true, "only rigs give"}, {FrameType::kRequest, 3, true, "on stream 3"},
                        {FrameType::kBulk, 0, true, "on stream 0"},     {FrameType::kBulk, 1, true, "not open"},
                        {FrameType::kCredit, 2, true, "never opened"},  {FrameType::kStreamClose, 1, true, "not open"},
                        {FrameType::kStreamOpen, 1, true, "policy 0"},  {FrameType::kStreamOpen, 2, true, "turn"}};
  for (const Case& c : cases) {
    Session rig(Role::kRig, make_hello("rig"));
    std::uint32_t sequence = 0;
    if (c.after_hello) {
      Session host(Role::kHost, make_hello("host"));
      ASSERT_TRUE(rig.receive(take_output(host)));
      sequence = 1;
    }
    const std::string payload = c.type == FrameType::kHello ? make_hello("host").SerializeAsString() : "";
    const std::span bytes(reinterpret_cast<const std::uint8_t*>(payload.data()), payload.size());
    (void)rig.receive(encode_frame_header(FrameHeader{c.type, 0, c.stream, sequence}, bytes));
    const Status status = rig.receive(bytes);
    ASSERT_FALSE(status) << c.says;
    EXPECT_EQ(status.error().code, Errc::kProtocol);
    EXPECT_NE(status.error().message.find(c.says), std::string::npos) << status.error().message;
  }
}

TEST(Session, LinkDownInTheMiddle_EndOfInputSaysOfWhat) {
  Conversation talk;
  talk.run();
  EXPECT_TRUE(talk.host->end_of_input());
  const StreamId stream = talk.rig->open_stream(StreamPolicy::kLossless).value();
  ASSERT_TRUE(talk.rig->offer(stream, BulkItem{"", shared_bytes(3 * kMaxPieceBytes), 0}));
  Conversation::move(*talk.rig, *talk.host, talk.at_host);
  Conversation::move(*talk.host, *talk.rig, talk.at_rig);  // the first credit
  for (int cut = 0; cut < 2; ++cut) {
    const auto out = talk.rig->output();
    ASSERT_TRUE(talk.host->receive(out));
    talk.rig->sent(out.size());
    const Status end = talk.host->end_of_input();
    ASSERT_FALSE(end);
    EXPECT_EQ(end.error().code, Errc::kLinkClosed);
    EXPECT_NE(end.error().message.find(cut == 0 ? "of a frame" : "of an item"), std::string::npos);
  }
}

TEST(Session, APing_IsAnsweredByItselfAndIsNoEvent) {
  Conversation talk;
  talk.run();
  talk.rig->ping();
  const auto ping = take_output(*talk.rig);
  EXPECT_EQ(ping.size(), kFrameHeaderBytes);
  for (int i = 0; i < 3; ++i) talk.rig->ping();
  EXPECT_EQ(take_output(*talk.rig).size(), kFrameHeaderBytes) << "any number of pings before a write are one";
  ASSERT_TRUE(talk.host->receive(ping));
  EXPECT_FALSE(talk.host->next_event());
  const auto pong = take_output(*talk.host);
  ASSERT_EQ(pong.size(), kFrameHeaderBytes);
  EXPECT_TRUE(talk.rig->receive(pong));
  EXPECT_FALSE(talk.rig->next_event());
}

TEST(Session, APeerOfAVersionWithoutPings_IsNotPinged) {
  wire::Hello old = make_hello("old");
  old.set_protocol_max(1);
  Session host(Role::kHost, old);
  Session rig(Role::kRig, make_hello("rig"));
  ASSERT_TRUE(rig.receive(take_output(host)));
  EXPECT_EQ(rig.version(), 1u);
  (void)take_output(rig);
  rig.ping();
  EXPECT_TRUE(take_output(rig).empty());
}

}  // namespace
}  // namespace nodal
