#include "host_tool/rig/rig_connection.h"

#include <gtest/gtest.h>

#include "fake_rig.h"
#include "hal/sim/link.h"
#include "host_tool/console/console.h"
#include "host_tool/rig/upload.h"
#include "protocol/upload.h"

namespace nodal::host {
namespace {

constexpr Duration kPatience = Duration::milliseconds(50);

Result<std::unique_ptr<RigConnection>> talk_to(FakeRig& rig) {
  return RigConnection::over(std::move(rig.host_end), "sim:rig", kPatience, rig.waiter());
}

wire::Request status_request() {
  wire::Request request;
  request.mutable_status();
  return request;
}

wire::Reply status_reply(std::uint64_t sets) {
  wire::Reply reply;
  reply.mutable_status()->set_sets(sets);
  return reply;
}

TEST(RigConnection, Question_GetsItsOwnAnswer) {
  FakeRig rig;
  rig.answer = [](const wire::Request& request) { return status_reply(request.id() * 10); };
  auto connection = talk_to(rig);
  ASSERT_TRUE(connection) << connection.error().text();
  EXPECT_EQ((*connection)->ask(status_request())->status().sets(), 10U);
  EXPECT_EQ((*connection)->ask(status_request())->status().sets(), 20U);
}

TEST(RigConnection, AnswerTogetherWithAFarewell_IsTheAnswer) {
  FakeRig rig;
  rig.answer = [](const wire::Request&) { return status_reply(7); };
  auto connection =
      RigConnection::over(std::move(rig.host_end), "sim:rig", kPatience, [&](hal::LinkPort&, bool, Duration) {
        rig.step();
        if (!rig.requests.empty()) rig.hang_up();
      });
  ASSERT_TRUE(connection);
  const auto reply = (*connection)->ask(status_request());
  ASSERT_TRUE(reply) << reply.error().text();
  EXPECT_EQ(reply->status().sets(), 7U);
  EXPECT_FALSE((*connection)->ask(status_request()));
}

TEST(RigConnection, FarewellInTheSameBytes_LeavesTheAnswer) {
  FakeRig rig;
  rig.answer = [&](const wire::Request& request) -> std::optional<wire::Reply> {
    wire::Reply reply = status_reply(7);
    reply.set_id(request.id());
    EXPECT_TRUE(rig.session().send(reply));
    rig.session().close(Error{Errc::kLinkClosed, "the rig stops"});
    return std::nullopt;
  };
  auto connection = talk_to(rig);
  ASSERT_TRUE(connection);
  const auto reply = (*connection)->ask(status_request());
  ASSERT_TRUE(reply) << reply.error().text();
  EXPECT_EQ(reply->status().sets(), 7U);
}

TEST(RigConnection, ErrorTheRigAnswers_IsTheErrorOfTheQuestion) {
  FakeRig rig;
  rig.answer = [](const wire::Request&) {
    wire::Reply reply;
    reply.mutable_error()->set_code(static_cast<std::uint32_t>(Errc::kNotARotation));
    reply.mutable_error()->set_message("head 'cam3': a reflection");
    return reply;
  };
  auto connection = talk_to(rig);
  const auto reply = (*connection)->ask(status_request());
  ASSERT_FALSE(reply);
  EXPECT_EQ(reply.error().text(), "not-a-rotation (200): head 'cam3': a reflection");
}

TEST(RigConnection, RigThatNeverAnswers_IsATimeoutThatSaysHowLongAndWhatFor) {
  FakeRig rig;
  auto connection = talk_to(rig);
  ASSERT_TRUE(connection);
  const auto reply = (*connection)->ask(status_request());
  ASSERT_FALSE(reply);
  EXPECT_EQ(reply.error().code, Errc::kTimeout);
  EXPECT_NE(reply.error().message.find("50 ms"), std::string::npos);
  EXPECT_NE(reply.error().message.find("--timeout"), std::string::npos);
}

TEST(RigConnection, AnswerThatTakesLong_IsWaitedForWhileTheRigSaysWhatItDoes) {
  FakeRig rig;
  int looks = 0;
  rig.answer = [&](const wire::Request& request) -> std::optional<wire::Reply> {
    if (!request.has_status()) return std::nullopt;
    if (++looks == 3) {  // at the third poll the first request is done too
      wire::Reply done;
      done.set_id(rig.requests.front().id());
      done.mutable_done();
      EXPECT_TRUE(rig.session().send(done));
    }
    wire::Reply reply = status_reply(0);
    reply.mutable_status()->set_activity("compiling: " + std::to_string(looks));
    return reply;
  };
  auto connection = talk_to(rig);
  wire::Request commit;
  commit.mutable_upload_commit();
  std::vector<std::string> messages;
  const auto reply =
      (*connection)->ask_long(commit, [&](const wire::RigStatus& s) { messages.push_back(s.activity()); });
  ASSERT_TRUE(reply) << reply.error().text();
  EXPECT_TRUE(reply->has_done());
  EXPECT_EQ(messages, (std::vector<std::string>{"compiling: 1", "compiling: 2", "compiling: 3"}));
}

TEST(RigConnection, RigThatGoesSilentDuringALongRequest_IsATimeout) {
  FakeRig rig;
  auto connection = talk_to(rig);
  wire::Request commit;
  commit.mutable_upload_commit();
  const auto reply = (*connection)->ask_long(commit, [](const wire::RigStatus&) {});
  EXPECT_EQ(reply.error().code, Errc::kTimeout);
}

TEST(RigConnection, RigThatNeverSaysHello_IsATimeout) {
  FakeRig rig;
  auto connection =
      RigConnection::over(std::move(rig.host_end), "sim:rig", kPatience, [](hal::LinkPort&, bool, Duration) {});
  ASSERT_FALSE(connection);
  EXPECT_EQ(connection.error().code, Errc::kTimeout);
}

TEST(RigConnection, RigOfAnotherVersion_IsAVersionMismatch) {
  wire::Hello hello = make_hello("from the future");
  hello.set_protocol_min(kProtocolMax + 1);
  hello.set_protocol_max(kProtocolMax + 5);
  FakeRig rig(hello);
  const auto connection = talk_to(rig);
  ASSERT_FALSE(connection);
  EXPECT_EQ(connection.error().code, Errc::kVersionMismatch);
}

TEST(RigConnection, LinkThatGoesDownWhileAnAnswerIsDue_IsLinkClosedAndStaysSo) {
  FakeRig rig;
  rig.answer = [&rig](const wire::Request&) -> std::optional<wire::Reply> {
    rig.link()->reset();
    return std::nullopt;
  };
  auto connection = talk_to(rig);
  const auto reply = (*connection)->ask(status_request());
  ASSERT_FALSE(reply);
  EXPECT_EQ(reply.error().code, Errc::kLinkClosed);
  EXPECT_NE(reply.error().message.find("sim:rig"), std::string::npos);
  EXPECT_EQ((*connection)->ask(status_request()).error().code, Errc::kLinkClosed);
}

TEST(RigConnection, BytesThatAreNoProtocol_AreAnErrorThatNamesTheRig) {
  FakeRig rig;
  auto [host, other] = hal::sim::make_link_pair("sim:web", "sim:host");
  const std::string page = "HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n";
  ASSERT_TRUE(other->write(std::span(reinterpret_cast<const std::uint8_t*>(page.data()), page.size())));
  const auto connection =
      RigConnection::over(std::move(host), "sim:web", kPatience, [](hal::LinkPort&, bool, Duration) {});
  ASSERT_FALSE(connection);
  EXPECT_EQ(connection.error().code, Errc::kProtocol);
  EXPECT_NE(connection.error().message.find("sim:web"), std::string::npos);
}

TEST(RigConnection, PiecesThatComeWithTheAnswer_AreKeptInOrder) {
  FakeRig rig;
  rig.answer = [&rig](const wire::Request&) {
    const StreamId stream = *rig.session().open_stream(StreamPolicy::kLossless);
    for (std::uint8_t i = 0; i < 5; ++i) {
      const auto body = std::make_shared<const std::vector<std::uint8_t>>(1000, i);
      EXPECT_TRUE(rig.session().offer(stream, {"meta", body, 0}));
    }
    wire::Reply reply;
    reply.mutable_pull()->set_stream(stream);
    return reply;
  };
  auto connection = talk_to(rig);
  wire::Request pull;
  pull.mutable_pull();
  ASSERT_TRUE((*connection)->ask(pull));
  int next = 0;
  for (int i = 0; i < 100 && next < 5; ++i) {
    const auto event = (*connection)->next_event(kPatience);
    ASSERT_TRUE(event) << event.error().text();
    ASSERT_TRUE(*event);
    if (const auto* piece = std::get_if<BulkPiece>(&**event)) {
      EXPECT_EQ(piece->data, std::vector<std::uint8_t>(1000, static_cast<std::uint8_t>(next)));
      ++next;
    }
  }
  EXPECT_EQ(next, 5);
}

// --- a rig that hangs, and one that is only quiet --------------------------------------------------------

TEST(RigConnection, SilentRig_IsGivenUpWhileItsEventsAreWaitedFor) {
  FakeRig rig;
  auto connection = talk_to(rig);
  ASSERT_TRUE(connection);
  const auto event = (*connection)->next_event(Duration::seconds(5));
  ASSERT_FALSE(event) << "waited for a rig that hangs";
  EXPECT_EQ(event.error().code, Errc::kTimeout);
  EXPECT_NE(event.error().message.find("the rig has sent nothing for"), std::string::npos) << event.error().message;
}

TEST(RigConnection, QuietRigThatAnswers_IsWaitedForLongerThanThePatience) {
  FakeRig rig;
  rig.answer = [](const wire::Request&) { return status_reply(1); };
  auto connection = talk_to(rig);
  ASSERT_TRUE(connection);
  const auto event = (*connection)->next_event(kPatience * 4);
  ASSERT_TRUE(event) << event.error().text();
  EXPECT_FALSE(*event);
  EXPECT_GE(rig.requests.size(), 1U);  // status requests to check that the rig is alive
}

TEST(RigConnection, PiecesWhileAnAnswerIsDue_GiveTheRigNoCreditForMore) {
  FakeRig rig;
  StreamId stream = 0;
  rig.answer = [&](const wire::Request&) -> std::optional<wire::Reply> {
    stream = *rig.session().open_stream(StreamPolicy::kLossless);
    const auto body = std::make_shared<const std::vector<std::uint8_t>>(1 << 20);
    for (std::size_t i = 0; i < kLosslessQueueItems; ++i) EXPECT_TRUE(rig.session().offer(stream, {"meta", body, 0}));
    return std::nullopt;
  };
  auto connection = RigConnection::over(std::move(rig.host_end), "sim:rig", Duration::seconds(1), rig.waiter());
  ASSERT_TRUE(connection);
  EXPECT_EQ((*connection)->ask(status_request()).error().code, Errc::kTimeout);
  const auto counts = rig.session().counts(stream);
  ASSERT_TRUE(counts);
  EXPECT_LE(counts->delivered, kHostLosslessWindowBytes >> 20);  // items of 1 MiB; all 8 if every piece granted credit
}

TEST(RigConnection, AnswerToAQuestionThatWasGivenUp_IsNoAnswerToTheNext) {
  FakeRig rig;
  std::optional<wire::Request> unanswered;
  rig.answer = [&](const wire::Request& request) -> std::optional<wire::Reply> {
    if (!unanswered) {
      unanswered = request;
      return std::nullopt;
    }
    wire::Reply late = status_reply(1);
    late.set_id(unanswered->id());
    EXPECT_TRUE(rig.session().send(late));
    return status_reply(2);
  };
  auto connection = talk_to(rig);
  ASSERT_TRUE(connection);
  EXPECT_EQ((*connection)->ask(status_request()).error().code, Errc::kTimeout);
  const auto reply = (*connection)->ask(status_request());
  ASSERT_TRUE(reply) << reply.error().text();
  EXPECT_EQ(reply->status().sets(), 2U);
}

// --- uploads -------------------------------------------------------------------------------------------

std::vector<std::uint8_t> document_of(std::size_t size) {
  std::vector<std::uint8_t> document(size);
  for (std::size_t i = 0; i < size; ++i) document[i] = static_cast<std::uint8_t>(i * i * 7 + i);
  return document;
}

FakeRig::Answer upload_answers(UploadReceiver& uploads, std::vector<std::uint8_t>& taken) {
  return [&uploads, &taken](const wire::Request& request) -> std::optional<wire::Reply> {
    wire::Reply reply;
    const auto refuse = [&reply](const Error& error) {
      reply.mutable_error()->set_code(static_cast<std::uint32_t>(error.code));
      reply.mutable_error()->set_message(error.message);
    };
    if (request.has_upload_begin()) {
      const auto offset =
          uploads.begin(*sha256_from_wire(request.upload_begin().sha256()), request.upload_begin().length());
      if (offset) {
        reply.mutable_upload()->set_offset(*offset);
      } else {
        refuse(offset.error());
      }
    } else if (request.has_upload_commit()) {
      auto document = uploads.take(*sha256_from_wire(request.upload_commit().sha256()));
      if (document) {
        taken = *document;
        reply.mutable_done();
      } else {
        refuse(document.error());
      }
    }
    return reply;
  };
}

class Uploads : public ::testing::Test {
 protected:
  Console console_{std::tmpfile(), std::tmpfile()};
  UploadReceiver receiver_;
  std::vector<std::uint8_t> taken_;
};

TEST_F(Uploads, WholeLink_ArrivesToTheByte) {
  FakeRig rig;
  rig.uploads = &receiver_;
  rig.answer = upload_answers(receiver_, taken_);
  const auto done = upload([&rig] { return talk_to(rig); }, document_of(200'000), 1, console_);
  ASSERT_TRUE(done) << done.error().text();
  EXPECT_EQ(taken_, document_of(200'000));
  EXPECT_EQ(done->resumed_at, 0U);
}

TEST_F(Uploads, LinkCutAgainAndAgain_GoesOnFromTheRigsOffset) {
  // The document is larger than three of the four links can carry before they break.
  const std::vector<std::uint8_t> document = document_of(400'000);
  std::vector<std::unique_ptr<FakeRig>> rigs;
  const auto connect = [&]() -> Result<std::unique_ptr<RigConnection>> {
    rigs.push_back(std::make_unique<FakeRig>());
    FakeRig& rig = *rigs.back();
    rig.uploads = &receiver_;
    rig.answer = upload_answers(receiver_, taken_);
    const int steps_to_live = rigs.size() < 4 ? 35 : 1'000'000;  // 35 reads: one complete piece and one torn piece
    hal::sim::SimLink* link = rig.link();
    return RigConnection::over(std::move(rig.host_end), "sim:rig", kPatience,
                               [&rig, link, left = steps_to_live](hal::LinkPort&, bool, Duration) mutable {
                                 rig.step();
                                 if (--left == 0) link->reset();
                               });
  };
  const auto done = upload(connect, document, 4, console_);
  ASSERT_TRUE(done) << done.error().text();
  EXPECT_EQ(done->links, 4);
  EXPECT_GT(done->resumed_at, 3U * 65'000);
  EXPECT_LT(done->resumed_at, 4U * 65'000);
  EXPECT_EQ(taken_, document);
}

TEST_F(Uploads, RigThatRefusesTheDocument_IsNotAskedAgain) {
  FakeRig rig;
  rig.uploads = &receiver_;
  rig.answer = [this](const wire::Request& request) {
    wire::Reply reply = *upload_answers(receiver_, taken_)(request);
    if (request.has_upload_commit()) {
      reply.Clear();
      reply.mutable_error()->set_code(static_cast<std::uint32_t>(Errc::kHeadMismatch));
      reply.mutable_error()->set_message("the rig has no head 'cam9'");
    }
    return reply;
  };
  int links = 0;
  const auto done = upload(
      [&] {
        ++links;
        return talk_to(rig);
      },
      document_of(1000), 4, console_);
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, Errc::kHeadMismatch);
  EXPECT_EQ(links, 1);
}

TEST_F(Uploads, NobodyThereAtFirst_IsNotTriedAgain) {
  int links = 0;
  const auto done = upload(
      [&]() -> Result<std::unique_ptr<RigConnection>> {
        ++links;
        return fail(Errc::kUnreachable, "no rig");
      },
      document_of(10), 4, console_);
  EXPECT_EQ(done.error().code, Errc::kUnreachable);
  EXPECT_EQ(links, 1);
}

}  // namespace
}  // namespace nodal::host
