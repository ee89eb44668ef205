/// @file limber/precompute/modal_analysis.h
/// The lowest vibration modes of one connected body: K w = λ M w, WᵀMW = I, none missed.
///
/// Null space. K w = 0 exactly for motions that are rigid on every set of face-connected tets and agree at shared
/// nodes. That is a small dense problem in six unknowns per set, so rigid motions and mechanisms are found from
/// geometry, not by a threshold on eigenvalues; the inertia of K − σM just above zero confirms the count. Elastic
/// modes. ARPACK, shift-invert in the M inner product, on CHOLMOD's supernodal LLᵀ, the null space deflated.
/// Certificate. The number of eigenvalues below a σ just above the last one, by Sylvester's law of inertia from a
/// pivoted LDLᵀ (MUMPS), equals the number found. docs/modal-analysis.md tells what was measured and why it is done so.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "limber/core/jobs.h"
#include "limber/mesh/tet_mesh.h"
#include "limber/model/material.h"
#include "limber/model/modal_model.h"
#include "limber/precompute/elastic_compliance.h"
#include "limber/precompute/fem.h"
#include "limber/precompute/spectrum_slice.h"

namespace limber {

struct ModalAnalysisOptions {
  int modes = 64;             ///< elastic modes wanted; ≥ 0. A cluster of equal ones at the end is completed.
  double below = kUnbounded;  ///< rad²/s², > 0: of these only as many as have λ < below, counted by inertia
  MassKind mass = MassKind::kLumped;
  bool certify = true;           ///< prove by inertia that no mode is missed
  bool keep_compliance = false;  ///< also return K⁺, at the memory of its factor
  /// Threads of the BLAS, set for the length of a call; 0: one per processor. More than one pays on meshes of tens of
  /// thousands of nodes on a quiet machine; on a busy one their waiting can cost twenty times what they save. The last
  /// bits of the modes depend on it.
  int blas_threads = 1;
  /// Where there are any, modes are theirs: those of this body, none missing from 0 Hz on.
  std::vector<SpectrumSlice> slices = {};
  std::uint64_t seed = 0;  ///< of Lanczos's start vector: modes agree for all seeds to about 1e-6, bits do not
  void validate() const;
};

/// Motions of one body that store no energy.
struct BodyFreedom {
  FrameMotion motion = FrameMotion::kFree;  ///< what the fixed nodes leave free
  Vec3 pivot = Vec3::Zero();                ///< kPoint, kLine: a fixed point, mesh coordinates
  Vec3 line_axis = Vec3::UnitX();           ///< kLine
  int rigid_modes = 0;                      ///< 6, 3, 1 or 0: dimension of the rigid motions that are free
  int mechanisms = 0;                       ///< further zero modes
  int zero_modes() const { return rigid_modes + mechanisms; }
};

/// How well pairs λ, w solve K w = λ M w.
struct EigenAccuracy {
  double residual_max = 0.0;        ///< ‖Kw − λMw‖ / ‖λMw‖ of the elastic mode that is nearest to its bound
  double residual_bound = 0.0;      ///< its bound: max(1e-8, 100ε‖K‖‖w‖/‖λMw‖)
  double backward_error_max = 0.0;  ///< max of ‖Kw − λMw‖ / ((‖K‖ + λ‖M‖)‖w‖)
  double orthogonality_max = 0.0;   ///< max |WᵀMW − I|, rigid motions included
  bool certified = false;           ///< a count of eigenvalues proves that none is missed
};

struct EigenSeconds {
  double assemble = 0.0, order = 0.0, factor = 0.0, iterate = 0.0, certify = 0.0;
};

struct ModalAnalysis {
  BodyFreedom freedom;
  int elastic_below = -1;                 ///< how many elastic modes have λ < options.below; −1: not asked for
  std::vector<double> eigenvalues;        ///< mechanisms (λ = 0 exactly) first, then elastic, ascending; rad²/s²
  std::vector<double> shapes;             ///< W, column-major 3n × k, kg^−½, zero at fixed nodes
  std::vector<double> mass_times_shapes;  ///< M W, the same shape, kg^½
  Index nodes = 0;
  std::shared_ptr<ElasticCompliance> compliance;  ///< where it was asked for and a node is free, else null
  EigenAccuracy accuracy;
  EigenSeconds seconds;
  int solves = 0;  ///< right-hand sides solved
};

/// @param mesh one connected body (connected_components), every node used, validated.
/// @param materials one per region. @param fixed_nodes all three components held; may be empty; indices into mesh.nodes
/// Repeated runs give the same bits: fixed start vector, canonical rotation inside clusters of equal eigenvalues,
/// canonical sign.
/// @throws ComputationError if the certificate fails after another try, or the factorisation does (naming the likely
/// cause)
ModalAnalysis analyse_modes(const TetMesh& mesh, std::span<const Material> materials,
                            std::span<const Index> fixed_nodes, const ModalAnalysisOptions& options, Warnings& warnings,
                            Jobs& jobs = serial_jobs());

/// The modes of a band, for ModalAnalysisOptions::slices. @param options all but modes, below, slices and
/// keep_compliance count
/// @throws ComputationError as above, or if an end of the band is an eigenvalue
SpectrumSlice analyse_slice(const TetMesh& mesh, std::span<const Material> materials,
                            std::span<const Index> fixed_nodes, const FrequencyBand& band,
                            const ModalAnalysisOptions& options, Warnings& warnings, Jobs& jobs = serial_jobs());

}  // namespace limber
