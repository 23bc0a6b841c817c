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
  talk.run();
  ASSERT_EQ(talk.at_host.size(), 1u);
  ASSERT_EQ(talk.at_rig.size(), 1u);
  EXPECT_EQ(std::get<wire::Hello>(talk.at_host[0]).software(), "nodald test");
  EXPECT_EQ(std::get<wire::Hello>(talk.at_rig[0]).software(), "nodal test");
  ASSERT_NE(talk.host->peer_hello(), nullptr);
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

TEST(Session, LosslessItem_ArrivesWholeWithItsMeta) {
  Conversation talk;
  talk.run();
  const auto body = shared_bytes(10'000'000);  // more than any window
  const auto stream = talk.rig->open_stream(StreamPolicy::kLossless);
  ASSERT_TRUE(stream);
  ASSERT_TRUE(talk.rig->offer(*stream, BulkItem{"about it", body, 0}));
  talk.run();
  std::vector<std::uint8_t> got;
  for (const BulkPiece& piece : only<BulkPiece>(talk.at_host)) {
    EXPECT_EQ(piece.stream, *stream);
    EXPECT_EQ(piece.offset, got.size());
    EXPECT_EQ(piece.total, body->size());
    EXPECT_EQ(piece.meta, piece.first ? "about it" : "");
    got.insert(got.end(), piece.data.begin(), piece.data.end());
    EXPECT_EQ(piece.last, got.size() == body->size());
  }
  EXPECT_EQ(got, *body);
  EXPECT_EQ(talk.rig->counts(*stream)->delivered, 1u);
}

}  // namespace
}  // namespace nodal
