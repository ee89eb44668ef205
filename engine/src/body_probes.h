// What asks where bodies are and moves none: queries and sensors.
#pragma once

#include "body_queries.h"
#include "sensor_stage.h"

namespace limber::internal {

struct BodyProbes {
  explicit BodyProbes(BodyTable& bodies) : queries(bodies), sensors(bodies, queries) {}

  BodyQueries queries;
  SensorStage sensors;
};

}  // namespace limber::internal
