classdef EndoTwin < matlab.System
    % Bending angle of the endoscope, for a MATLAB System block of Simulink.
    %
    % Start docs/examples/tcp_server.py first. Inputs at each sample: time [s], commanded pull [mm] and
    % measured angle [deg], NaN where one is missing. Outputs: estimate, lower and upper end of its 95 %
    % interval [deg], and whether the trained estimator made it. Use a fixed step, the T of the training.

    properties (Nontunable)
        Host = '127.0.0.1'
        Port = 5555
    end

    properties (Access = private)
        Client
    end

    methods (Access = protected)
        function setupImpl(obj)
            obj.Client = tcpclient(obj.Host, obj.Port, 'Timeout', 5);
            configureTerminator(obj.Client, "LF");
        end

        function [bend, low, high, trusted] = stepImpl(obj, time, pull, measurement)
            sample = struct('time_s', time, 'pull_mm', pull, 'measurement_deg', measurement);
            writeline(obj.Client, jsonencode(sample)); % NaN becomes null
            answer = jsondecode(char(readline(obj.Client)));
            if isfield(answer, 'error')
                error('EndoTwin:line', '%s', answer.error);
            end
            interval = [NaN; NaN]; % null where it is unknown
            if ~isempty(answer.interval_deg)
                interval = answer.interval_deg;
            end
            bend = answer.bend_deg;
            low = interval(1);
            high = interval(2);
            trusted = double(strcmp(answer.source, 'advanced'));
        end

        function releaseImpl(obj)
            obj.Client = [];
        end

        function [a, b, c, d] = getOutputSizeImpl(~)
            [a, b, c, d] = deal([1 1]);
        end

        function [a, b, c, d] = getOutputDataTypeImpl(~)
            [a, b, c, d] = deal('double');
        end

        function [a, b, c, d] = isOutputComplexImpl(~)
            [a, b, c, d] = deal(false);
        end

        function [a, b, c, d] = isOutputFixedSizeImpl(~)
            [a, b, c, d] = deal(true);
        end
    end

    methods (Static, Access = protected)
        function mode = getSimulateUsingImpl
            mode = 'Interpreted execution'; % tcpclient generates no code
        end
    end
end
