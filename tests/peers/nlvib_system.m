function u = nlvib_system(file, direction, stiffness, omega, monitor)
% Response of an exported body with a spring along a force direction, from the fields that NLvib's constructor
%   MechanicalSystem(M, D, K, nonlinear_elements, Fex1)
% takes: M, D, K, a cell of elements with 'force_direction', and one column of Fex1. The spring is linear, so that the
% answer is known; u is (rows of the monitor, frequencies), complex, for exp(i omega t).
b = load(file);
b = b.speed_0;
element = struct('type', 'spring', 'stiffness', stiffness, 'force_direction', b.W(:, strcmp(b.W_row, direction)));
system = struct('M', b.M, 'D', b.D, 'K', b.K, 'nonlinear_elements', {{element}}, 'Fex1', b.Fex1(:, 1));
assert(length(system.Fex1) == length(system.M));
w = system.nonlinear_elements{1}.force_direction;
K = system.K + stiffness * (w * w');
u = zeros(rows(b.monitors.(monitor).T), length(omega));
for j = 1:length(omega)
  q = (-omega(j)^2 * system.M + 1i * omega(j) * system.D + K) \ system.Fex1;
  u(:, j) = b.monitors.(monitor).T * q;
end
end
