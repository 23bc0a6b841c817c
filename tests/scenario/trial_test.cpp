// A calibration on trial: kept on a host's request, and undone by the rig without one.
#include <gtest/gtest.h>

#include "protocol/upload.h"
#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

constexpr Duration kTrial = Duration::seconds(30);

/// Like a normal upload, but on trial.
wire::Reply try_out(Stand& stand, TestHost& host, const Calibration& calibration, Duration trial = kTrial) {
  const std::string document = to_json(calibration);
  host.send_document(document);
  stand.run(Duration::seconds(1));
  const auto bytes = std::make_shared<const std::vector<std::uint8_t>>(document.begin(), document.end());
  wire::Request commit;
  *commit.mutable_upload_commit() = UploadSender(bytes).commit();
  commit.mutable_upload_commit()->set_trial_ns(static_cast<std::uint64_t>(trial.ns()));
  return host.ask(commit);
}

wire::Reply end_trial(TestHost& host, bool keep, const std::string& id = "") {
  wire::Request request;
  request.mutable_trial_end()->set_id(id);
  request.mutable_trial_end()->set_keep(keep);
  return host.ask(request);
}

std::string trial_id(const Calibration& calibration) { return sha256_to_wire(calibration_id(calibration)); }
std::string in_force(TestHost& host) { return host.status().calibration_id(); }

/// The calibration with which the newest raymap was made.
std::string blended_by(Stand& stand, TestHost& host) {
  const StreamId stream = host.pull(false, 1);
  EXPECT_TRUE(stand.run_until([&] { return host.closed.contains(stream); }));
  return host.pulled[stream].empty() ? "" : host.pulled[stream].front().header.calibration_id();
}

/// The rig is restarted with the disk's content.
std::string in_force_after_a_restart(std::unique_ptr<hal::sim::SimDisk> disk) {
  Stand again({}, std::move(disk));
  TestHost& host = again.connect();
  again.run(Duration::seconds(1));
  return in_force(host);
}

class Trials : public testing::Test {
 protected:
  void SetUp() override {
    host_ = &stand_.bring_up();
    const wire::Reply tried = try_out(stand_, *host_, better_);
    ASSERT_TRUE(tried.has_done()) << tried.error().message();
  }
  Stand stand_;
  TestHost* host_ = nullptr;
  const Calibration good_ = small_calibration();
  const Calibration better_ = small_calibration("better");
};

TEST_F(Trials, OnTrial_ItRunsAndIsToldAndOnlyTheOldOneIsStored) {
  EXPECT_EQ(blended_by(stand_, *host_), trial_id(better_));
  const wire::RigStatus status = host_->status();
  ASSERT_TRUE(status.has_trial());
  EXPECT_EQ(status.trial().id(), trial_id(better_));
  EXPECT_EQ(status.trial().before(), trial_id(good_));
  EXPECT_GT(status.trial().left_ns(), 20'000'000'000u);
  EXPECT_LE(status.trial().left_ns(), 30'000'000'000u);
  wire::Request list, get;
  list.mutable_calibration_list();
  const wire::Reply all = host_->ask(list);
  ASSERT_EQ(all.calibrations().entries_size(), 2);
  EXPECT_TRUE(all.calibrations().entries(0).on_trial());
  EXPECT_TRUE(all.calibrations().entries(0).in_force());
  EXPECT_FALSE(all.calibrations().entries(1).in_force());
  get.mutable_calibration_get();
  EXPECT_EQ(host_->ask(get).calibration().json(), canonical_json(better_));
  EXPECT_EQ(in_force_after_a_restart(stand_.disk->after_kill()), trial_id(good_));
}

TEST_F(Trials, Kept_ItIsInForceForGoodAndAfterARestart) {
  ASSERT_TRUE(end_trial(*host_, true, trial_id(better_).substr(0, 3)).has_done());
  stand_.run(kTrial + Duration::seconds(1));
  EXPECT_EQ(in_force(*host_), trial_id(better_));
  EXPECT_FALSE(host_->status().has_trial());
  EXPECT_EQ(in_force_after_a_restart(stand_.disk->after_kill()), trial_id(better_));
  // The way back works as usual.
  wire::Request back;
  back.mutable_calibration_rollback();
  ASSERT_TRUE(host_->ask(back).has_done());
  EXPECT_EQ(blended_by(stand_, *host_), trial_id(good_));
}

TEST_F(Trials, Refused_TheOldOneRunsWhenTheAnswerIsThere) {
  ASSERT_TRUE(end_trial(*host_, false).has_done());
  EXPECT_EQ(in_force(*host_), trial_id(good_));
  EXPECT_EQ(blended_by(stand_, *host_), trial_id(good_));
  const wire::Reply again = end_trial(*host_, true);
  EXPECT_EQ(again.error().code(), static_cast<std::uint32_t>(Errc::kWrongState)) << again.error().message();
  // A calibration can be tried again.
  EXPECT_TRUE(try_out(stand_, *host_, better_).has_done());
}

TEST_F(Trials, TheHostVanishes_TheRigGoesBackByItselfInTimeAndSaysSo) {
  host_->link().reset();
  stand_.run(Duration::seconds(5));
  TestHost& other = stand_.connect();
  EXPECT_EQ(in_force(other), trial_id(better_)) << "a lost link alone ends nothing";
  stand_.rig->control().take_news();
  stand_.run(kTrial);
  EXPECT_EQ(in_force(other), trial_id(good_));
  EXPECT_EQ(blended_by(stand_, other), trial_id(good_));
  const std::vector<std::string> news = stand_.rig->control().take_news();
  EXPECT_TRUE(std::any_of(news.begin(), news.end(), [](const std::string& sentence) {
    return sentence == "the trial has ended; calibration 'small' is in force again";
  }));
}

TEST_F(Trials, ThePowerGoes_TheGoodOneIsInForceWhateverTheDiskLost) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    EXPECT_EQ(in_force_after_a_restart(stand_.disk->after_power_loss(seed)), trial_id(good_)) << seed;
  }
}

TEST_F(Trials, AnotherCalibrationMeanwhile_IsToldToWaitAndARollbackEndsTheTrial) {
  const wire::Reply upload = host_->upload(to_json(small_calibration("third")));
  EXPECT_EQ(upload.error().code(), static_cast<std::uint32_t>(Errc::kBusy));
  EXPECT_NE(upload.error().message().find("is on trial for another "), std::string::npos) << upload.error().message();
  EXPECT_EQ(end_trial(*host_, true, "xyz").error().code(), static_cast<std::uint32_t>(Errc::kNotFound));
  EXPECT_EQ(in_force(*host_), trial_id(better_));
  wire::Request back;
  back.mutable_calibration_rollback();
  ASSERT_TRUE(host_->ask(back).has_done());
  EXPECT_EQ(blended_by(stand_, *host_), trial_id(good_));
  EXPECT_TRUE(host_->upload(to_json(small_calibration("third"))).has_done());
}

TEST_F(Trials, TheDiskIsFullWhenItShouldBeKept_TheTrialGoesOnAndTheOldOneComesBack) {
  stand_.disk->set_capacity((std::uint64_t{1} << 40) - *stand_.disk->free_bytes());
  const wire::Reply kept = end_trial(*host_, true);
  EXPECT_EQ(kept.error().code(), static_cast<std::uint32_t>(Errc::kDiskFull)) << kept.error().message();
  EXPECT_EQ(in_force(*host_), trial_id(better_));
  stand_.run(kTrial);
  EXPECT_EQ(blended_by(stand_, *host_), trial_id(good_));
  EXPECT_EQ(in_force_after_a_restart(stand_.disk->after_kill()), trial_id(good_));
}

TEST(Trial, NothingToGoBackTo_IsRefused) {
  Stand stand;
  TestHost& host = stand.connect();
  stand.run(Duration::seconds(1));
  const wire::Reply tried = try_out(stand, host, small_calibration());
  EXPECT_EQ(tried.error().code(), static_cast<std::uint32_t>(Errc::kWrongState));
  EXPECT_TRUE(host.upload(to_json(small_calibration())).has_done());
  EXPECT_EQ(try_out(stand, host, small_calibration()).error().code(), static_cast<std::uint32_t>(Errc::kExists));
  EXPECT_EQ(try_out(stand, host, small_calibration("b"), Duration::milliseconds(10)).error().code(),
            static_cast<std::uint32_t>(Errc::kBadValue));
}

}  // namespace
}  // namespace nodal::scenario
