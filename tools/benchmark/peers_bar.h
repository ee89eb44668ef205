/// @file peers_bar.h
/// The bar that limber and Bullet bend by the same modes, and what it costs in limber.
#pragma once

#include <memory>

#include "limber/model/modal_model.h"
#include "peers.h"

namespace limber::tools {

/// The bar at a resolution, with stiffness such that the highest mode is well within what explicit steps bear.
struct Bar {
  std::shared_ptr<const ModalModel> model;
  ReducedBody nodes, surface;
};

/// @param vertices about so many of the surface; 0: as it is drawn. @param step s
Bar make_bar(int modes, int vertices, double step);

ReducedCost run_limber(const Bar& bar, const ReducedRun& run);

}  // namespace limber::tools
