"""Reference method in numpy and Clarabel: problems (21), (22), (27) at one posture.

The reference method is slow but also covers rigid closures, nearly singular matrices
and active motion limits of passive joints.  It is selected by ``method="reference"``,
and it solves points that the compiled method does not cover or cannot certify.

=========  ==========================================  ===============================
paper      quantity or problem                         function
=========  ==========================================  ===============================
(16)-(20)  A (dl + dc + de + db) = 0, dx_p from them   ``closure.linearise``
(1)-(7)    dc = cones u + free q, de and db = springs  ``closure.virtual_joints``
           y, so that E = |y|^2 / 2
--         q and y eliminated: E = |G u + h|^2 / 2,    ``reduction.reduce_problem``
           H u = k where no spring acts
(21)       smallest t with every |u_c| <= t            ``zone.least_margin``
(22)       minimum of E - work, every |u_c| <= 1       ``energy.least_energy``
(23)-(26)  wrenches, from multipliers of the closures  ``assembled.Assembly``
(27)       set of possible dx_p; bounds on its         ``pose_error.reachable_screws``,
           largest element                             ``ReachableSet.farthest``
=========  ==========================================  ===============================

``closure.py`` and ``assembled.py`` are in the parent folder because the compiled
methods use them as well.  :mod:`forcefit.assembly.solvers.conic` solves the cone
programs.  ``as_printed.py`` solves (21) and (22) a second time in cvxpy, as printed in
the paper.
"""
