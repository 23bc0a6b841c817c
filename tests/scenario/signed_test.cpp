// A rig with signers in rig.toml uses no calibration that none of them signed, wherever it came from.
#include <gtest/gtest.h>

#include "protocol/signed_for.h"
#include "tests/scenario/stand.h"
#include "tests/support/ssh_keys.h"

namespace nodal::scenario {
namespace {

std::string id_of(const Calibration& calibration) { return sha256_to_wire(calibration_id(calibration)); }

class Signed : public testing::Test {
 protected:
  StandOptions trusting(const std::string& allowed_signers) {
    StandOptions options;
    auto signers = AllowedSigners::parse(allowed_signers);
    EXPECT_TRUE(signers) << signers.error().text();
    options.config.signers = std::move(*signers);
    return options;
  }
  /// Uploads the document with the signature; `trial_ns` 0: permanently.
  wire::Reply upload(Stand& stand, TestHost& host, const std::string& document, const std::string& signature,
                     std::uint64_t trial_ns = 0, bool allow_older = false) {
    host.send_document(document);
    stand.run(Duration::seconds(1));  // control frames overtake bulk frames
    wire::Request commit;
    const auto bytes = std::make_shared<const std::vector<std::uint8_t>>(document.begin(), document.end());
    *commit.mutable_upload_commit() = UploadSender(bytes).commit();
    commit.mutable_upload_commit()->set_signature(signature);
    commit.mutable_upload_commit()->set_allow_older(allow_older);
    if (trial_ns != 0) commit.mutable_upload_commit()->set_trial_ns(trial_ns);
    return host.ask(commit);
  }
  /// By ann, for this rig.
  std::string sign(const std::string& document, std::uint64_t generation, const std::string& who = "ann") {
    return keys_.sign(who, document, namespace_of({StandOptions().config.name, generation}));
  }
  static wire::Reply use(TestHost& host, const Calibration& calibration, bool allow_older = false) {
    wire::Request request;
    request.mutable_calibration_use()->set_id(id_of(calibration));
    request.mutable_calibration_use()->set_allow_older(allow_older);
    return host.ask(request);
  }
  static void expect_refused(const wire::Reply& reply, const std::string& words) {
    EXPECT_EQ(reply.error().code(), static_cast<std::uint32_t>(Errc::kBadValue)) << reply.error().message();
    EXPECT_NE(reply.error().message().find(words), std::string::npos) << reply.error().message();
  }
  static wire::Reply rollback(TestHost& host) {
    wire::Request request;
    request.mutable_calibration_rollback();
    return host.ask(request);
  }

  test::SshKeys keys_;
  const std::string ann_ = "ann " + keys_.make("ann");
  const std::string bob_ = "bob " + keys_.make("bob");
  const Calibration first_ = small_calibration("first");
  const Calibration second_ = small_calibration("second");
};

TEST_F(Signed, OnlyWhatASignerSignedForCalibrations_ComesIntoForce) {
  Stand stand(trusting(ann_));
  TestHost& host = stand.connect();
  stand.run(Duration::milliseconds(100));
  const std::string document = to_json(first_);
  const auto refused_as = [&](const std::string& signature, Errc code) {
    const wire::Reply reply = upload(stand, host, document, signature);
    EXPECT_EQ(reply.error().code(), static_cast<std::uint32_t>(code)) << reply.error().message();
    EXPECT_EQ(host.status().calibration_id(), "");
  };
  refused_as("", Errc::kBadValue);
  refused_as(keys_.sign("bob", document), Errc::kBadValue);
  refused_as(keys_.sign("ann", document, "git"), Errc::kBadValue);
  refused_as(sign(to_json(second_), 1), Errc::kChecksum);
  refused_as(std::string(5000, 'x'), Errc::kTooLarge);
  EXPECT_TRUE(upload(stand, host, document, sign(document, 1)).has_done());
  EXPECT_EQ(host.status().calibration_id(), id_of(first_));
}

TEST_F(Signed, AfterARestart_WhatWasSignedRunsAndWhatWasNotDoesNot) {
  Stand open;
  TestHost& host = open.connect();
  open.run(Duration::milliseconds(100));
  ASSERT_TRUE(host.upload(to_json(first_)).has_done()) << "before the rule came in";

  Stand strict(trusting(ann_), open.disk->after_power_loss(1));
  TestHost& other = strict.connect();
  strict.run(Duration::seconds(1));
  EXPECT_EQ(other.status().calibration_id(), "");
  EXPECT_NE(other.status().problem().find("not signed"), std::string::npos) << other.status().problem();
  wire::Request use;
  use.mutable_calibration_use()->set_id(id_of(first_));
  EXPECT_EQ(other.ask(use).error().code(), static_cast<std::uint32_t>(Errc::kBadValue));
  const std::string document = to_json(first_);
  ASSERT_TRUE(upload(strict, other, document, sign(document, 1)).has_done()) << "the same, signed by now";

  Stand again(trusting(ann_), strict.disk->after_power_loss(2));
  TestHost& last = again.connect();
  again.run(Duration::seconds(1));
  EXPECT_EQ(last.status().calibration_id(), id_of(first_));
}

TEST_F(Signed, ASignerWhoIsNoLongerTrusted_IsNoWayBack) {
  Stand stand(trusting(ann_ + bob_));
  TestHost& host = stand.connect();
  stand.run(Duration::milliseconds(100));
  ASSERT_TRUE(upload(stand, host, to_json(first_), sign(to_json(first_), 1)).has_done());
  ASSERT_TRUE(upload(stand, host, to_json(second_), sign(to_json(second_), 2, "bob")).has_done());

  Stand strict(trusting(bob_), stand.disk->after_power_loss(3));
  TestHost& other = strict.connect();
  strict.run(Duration::seconds(1));
  EXPECT_EQ(other.status().calibration_id(), id_of(second_));
  EXPECT_EQ(rollback(other).error().code(), static_cast<std::uint32_t>(Errc::kBadValue));
  EXPECT_EQ(other.status().calibration_id(), id_of(second_));
}

TEST_F(Signed, ATrial_NeedsASignatureAndKeepsIt) {
  constexpr std::uint64_t kTrial_ns = 30'000'000'000;
  Stand stand(trusting(ann_));
  TestHost& host = stand.connect();
  stand.run(Duration::milliseconds(100));
  ASSERT_TRUE(upload(stand, host, to_json(first_), sign(to_json(first_), 1)).has_done());
  EXPECT_EQ(upload(stand, host, to_json(second_), "", kTrial_ns).error().code(),
            static_cast<std::uint32_t>(Errc::kBadValue));
  ASSERT_TRUE(upload(stand, host, to_json(second_), sign(to_json(second_), 2), kTrial_ns).has_done());
  wire::Request keep;
  keep.mutable_trial_end()->set_keep(true);
  ASSERT_TRUE(host.ask(keep).has_done());

  Stand again(trusting(ann_), stand.disk->after_power_loss(4));
  TestHost& other = again.connect();
  again.run(Duration::seconds(1));
  EXPECT_EQ(other.status().calibration_id(), id_of(second_));
}

TEST_F(Signed, ForAnotherRig_IsRefusedWithTheCommandThatSignsForThisOne) {
  Stand stand(trusting(ann_));
  TestHost& host = stand.connect();
  stand.run(Duration::milliseconds(100));
  const std::string document = to_json(first_);
  const wire::Reply reply = upload(stand, host, document, keys_.sign("ann", document, "nodal-calibration:elsewhere:9"));
  expect_refused(reply, "for the rig 'elsewhere'");
  expect_refused(reply, "ssh-keygen -Y sign -n " + namespace_of({StandOptions().config.name, 1}));
  EXPECT_EQ(upload(stand, host, document, keys_.sign("ann", document, "nodal-calibration:elsewhere:9"), 0, true)
                .error()
                .code(),
            static_cast<std::uint32_t>(Errc::kBadValue))
      << "--allow-older is not for other rigs";
  EXPECT_EQ(host.status().calibration_id(), "");
}

TEST_F(Signed, OfAnOlderGeneration_IsRefusedAlsoAfterAPowerCut_UnlessItIsAllowed) {
  Stand stand(trusting(ann_));
  TestHost& host = stand.connect();
  stand.run(Duration::milliseconds(100));
  ASSERT_TRUE(upload(stand, host, to_json(first_), sign(to_json(first_), 5)).has_done());
  ASSERT_TRUE(upload(stand, host, to_json(second_), sign(to_json(second_), 6)).has_done());
  expect_refused(upload(stand, host, to_json(first_), sign(to_json(first_), 5)), "generation 5");
  expect_refused(upload(stand, host, to_json(first_), sign(to_json(first_), 6)), "generation 6");
  EXPECT_TRUE(upload(stand, host, to_json(second_), sign(to_json(second_), 6)).has_done()) << "the same again";

  Stand again(trusting(ann_), stand.disk->after_power_loss(5));
  TestHost& other = again.connect();
  again.run(Duration::seconds(1));
  EXPECT_EQ(other.status().calibration_id(), id_of(second_));
  expect_refused(use(other, first_), "generation 5");
  expect_refused(upload(again, other, to_json(first_), sign(to_json(first_), 5)), "--allow-older");
  EXPECT_TRUE(upload(again, other, to_json(first_), sign(to_json(first_), 5), 0, true).has_done());
  EXPECT_EQ(other.status().calibration_id(), id_of(first_));
  expect_refused(upload(again, other, to_json(second_), sign(to_json(second_), 4)), "generation 6");
  wire::Request list;
  list.mutable_calibration_list();
  EXPECT_EQ(other.ask(list).calibrations().signed_generation(), 6U) << "the highest, not the one in force";
}

TEST_F(Signed, ForNoRigAndNoGeneration_IsRefusedUnlessItIsAllowed_AndRunsAfterARestart) {
  Stand stand(trusting(ann_));
  TestHost& host = stand.connect();
  stand.run(Duration::milliseconds(100));
  const std::string signature = keys_.sign("ann", to_json(first_));
  expect_refused(upload(stand, host, to_json(first_), signature), "names no rig");
  ASSERT_TRUE(upload(stand, host, to_json(first_), signature, 0, true).has_done());

  Stand again(trusting(ann_), stand.disk->after_power_loss(6));
  TestHost& other = again.connect();
  again.run(Duration::seconds(1));
  EXPECT_EQ(other.status().calibration_id(), id_of(first_)) << "what was permitted once runs again";
}

TEST_F(Signed, AnOlderOneThatWasAllowed_IsInTheAuditLog) {
  Stand stand(trusting(ann_));
  TestHost& host = stand.connect();
  stand.run(Duration::milliseconds(100));
  ASSERT_TRUE(upload(stand, host, to_json(second_), sign(to_json(second_), 6)).has_done());
  ASSERT_TRUE(upload(stand, host, to_json(first_), sign(to_json(first_), 5), 0, true).has_done());
  wire::Request request;
  request.mutable_audit_log();
  const wire::Reply reply = host.ask(request);
  ASSERT_FALSE(reply.audit_log().entries().empty());
  const std::string after = reply.audit_log().entries().rbegin()->after();
  EXPECT_NE(after.find("older signature is allowed"), std::string::npos) << after;
}

TEST_F(Signed, AGenerationWhoseCalibrationDidNotComeIntoForce_IsNotUsedUp) {
  Stand stand(trusting(ann_));
  TestHost& host = stand.connect();
  stand.run(Duration::milliseconds(100));
  Calibration wrong = first_;
  wrong.heads.pop_back();
  EXPECT_TRUE(upload(stand, host, to_json(wrong), sign(to_json(wrong), 9)).has_error());
  EXPECT_TRUE(upload(stand, host, to_json(first_), sign(to_json(first_), 1)).has_done());
}

}  // namespace
}  // namespace nodal::scenario
